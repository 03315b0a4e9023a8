"""A report's sections as HTML, Markdown, LaTeX and CSV."""
