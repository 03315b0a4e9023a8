"""What a file or dataset holds, printed."""
