"""The document: every section that has something to say, in the order of a reader's questions."""

from __future__ import annotations

import datetime
from collections.abc import Sequence

from robocasa_lerobot.evaluation.report import left_out
from robocasa_lerobot.evaluation.report.formats.film_strip import choose_films
from robocasa_lerobot.evaluation.report.model import Document, Section
from robocasa_lerobot.evaluation.report.policies import ReportData
from robocasa_lerobot.evaluation.report.sections import (
    beside_published,
    comparison,
    data_efficiency,
    failures,
    horizon,
    kinds,
    lifelong,
    provenance,
    published_tables,
    robustness,
    stages,
    summary,
    tasks,
    training,
)
from robocasa_lerobot.evaluation.report.training import DemonstratorResult, Training


def build(
    data: ReportData,
    trainings: Sequence[Training] = (),
    demonstrators: Sequence[DemonstratorResult] = (),
    videos: bool = True,
) -> Document:
    """The report on `data`; `videos` embeds short films beside the film strips."""
    sections = [
        summary.section(data),
        left_out.section(data),
        data_efficiency.section(data),
        lifelong.section(data),
        robustness.section(data),
        beside_published.section(data),
        beside_published.others(data),
        comparison.section(data),
        _films(data, videos),
        failures.section(data),
        tasks.section(data),
        stages.section(data),
        kinds.section(data),
        horizon.section(data),
        training.section(trainings),
        training.demonstrator(demonstrators),
        provenance.section(data),
        provenance.errors(data),
        published_tables.section(data),
    ]
    headers = [policy.header for policy in data.policies]
    protocols = [header.protocol for header in headers]
    splits = [beside_published.SPLITS.get(header.split, header.split) for header in headers]
    return Document(
        title=data.title,
        headline=summary.headline(data),
        sections=[section for section in sections if section is not None],
        made=datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d %H:%M UTC"),
        synthetic=data.synthetic,
        tags=tuple(dict.fromkeys((*protocols, *splits))),
    )


def _films(data: ReportData, videos: bool) -> Section | None:
    films = choose_films(data, embed=videos)
    if not films:
        return None
    text = ("Left view above wrist view, filmed larger than the policy sees them; seconds since the start.",)
    return Section("films", "What it looks like", text, parts=tuple(films))
