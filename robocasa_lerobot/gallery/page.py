"""One HTML page with all pictures of a gallery in it, and filters by category and split."""

from __future__ import annotations

import base64
import html
import io
from pathlib import Path

from PIL import Image

from robocasa_lerobot.files import write_text
from robocasa_lerobot.gallery.sections import Tile

_HEAD = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>Kitchens</title>
<style>
body{font:14px/1.4 system-ui,sans-serif;margin:0;background:#fafafa;color:#222}
header{position:sticky;top:0;background:#fff;border-bottom:1px solid #ddd;padding:10px 20px}
h1{font-size:18px;display:inline;margin-right:24px}h2{margin:24px 20px 8px}
select{margin-right:14px}.grid{display:flex;flex-wrap:wrap;gap:10px;padding:0 20px}
figure{margin:0;background:#fff;border:1px solid #e2e2e2;border-radius:4px;overflow:hidden}
img{display:block}figcaption{padding:3px 8px;font-size:12px;max-width:460px}.target{border-color:#c98a2b}
</style></head><body>
"""
_SCRIPT = """<script>
const pick=id=>document.getElementById(id);
function show(){const c=pick('category').value,s=pick('split').value;
document.querySelectorAll('figure').forEach(f=>{f.hidden=(c&&f.dataset.category!==c)||(s&&f.dataset.split!==s)});
document.querySelectorAll('section').forEach(x=>{x.hidden=!x.querySelector('figure:not([hidden])')})}
['category','split'].forEach(id=>pick(id).addEventListener('change',show));
</script></body></html>
"""


def write_page(path: Path, sections: dict[str, list[Tile]]) -> Path:
    """Write the page: it loads nothing else. Returns its path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    categories = sorted({tile.category for tiles in sections.values() for tile in tiles})
    parts = [
        _HEAD,
        "<header><h1>Kitchens</h1>",
        _choice("category", categories),
        _choice("split", ["pretrain", "target"]),
    ]
    parts.append("</header>")
    for name, tiles in sections.items():
        parts.append(f"<section><h2>{html.escape(name)} ({len(tiles)})</h2><div class=grid>")
        parts += [_figure(tile) for tile in tiles]
        parts.append("</div></section>")
    write_text(path, "\n".join([*parts, _SCRIPT]))
    return path


def _choice(name: str, values: list[str]) -> str:
    options = "".join(f"<option>{html.escape(value)}</option>" for value in values)
    return f'<label>{name} <select id={name}><option value="">all</option>{options}</select></label>'


def _figure(tile: Tile) -> str:
    buffer = io.BytesIO()
    Image.fromarray(tile.picture).save(buffer, format="JPEG", quality=82)
    data = base64.b64encode(buffer.getvalue()).decode()
    height, width = tile.picture.shape[:2]
    return (
        f'<figure class={tile.split} data-category="{html.escape(tile.category)}" data-split={tile.split}>'
        f'<img loading=lazy width={width} height={height} alt="{html.escape(tile.title)}" '
        f'src="data:image/jpeg;base64,{data}"><figcaption>{html.escape(tile.title)}</figcaption></figure>'
    )
