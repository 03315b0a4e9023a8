"""The report: what was run, how sure the result is, and how it compares, from `trials.jsonl` alone.

`gather` reads runs into `ReportData`; each module of `sections` turns it into text, tables and figures of `model`;
`render` writes these as HTML, Markdown, LaTeX and CSV, so that all four always say the same.
"""
