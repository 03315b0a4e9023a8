"""What libraries print about every file that they write, silenced; their errors still arrive as exceptions."""

from __future__ import annotations


def quiet_libraries() -> None:
    """Silence codecs and the progress bars of `datasets`, in this process from now on."""
    import datasets

    datasets.disable_progress_bars()
    quiet_codecs()


def quiet_codecs() -> None:
    """Silence codecs, in this process from now on."""
    import av

    av.logging.set_libav_level(av.logging.ERROR)
