"""From a layout's file to where its fixtures stand: rows, islands, the room around them."""
