"""One module per section of the report; each makes a `Section` of `ReportData`, or None if it has nothing to say."""
