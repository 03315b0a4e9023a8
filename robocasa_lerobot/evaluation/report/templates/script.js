(function () {
  "use strict";
  // Colour theme: the system's, unless chosen here. Storage may be forbidden for a local file.
  var root = document.documentElement;
  var buttons = document.querySelectorAll("[data-theme-choice]");
  function show(choice) {
    if (choice === "auto") { root.removeAttribute("data-theme"); } else { root.setAttribute("data-theme", choice); }
    buttons.forEach(function (button) {
      button.setAttribute("aria-pressed", String(button.dataset.themeChoice === choice));
    });
  }
  function stored(choice) {
    try {
      if (choice) { localStorage.setItem("report-theme", choice); }
      return localStorage.getItem("report-theme");
    } catch (error) { return null; }
  }
  buttons.forEach(function (button) {
    button.addEventListener("click", function () { show(button.dataset.themeChoice); stored(button.dataset.themeChoice); });
  });
  var before = stored();
  if (before === "light" || before === "dark") { show(before); }

  // Tables sort by a column: numbers by data-sort, else by text; empty cells stay last.
  function key(row, index) {
    var cell = row.cells[index];
    if (cell.dataset.sort !== undefined) { return Number(cell.dataset.sort); }
    var text = cell.textContent.trim();
    return text === "" || text === "\u2013" ? null : text;
  }
  function compare(a, b) {
    if (typeof a === "number" && typeof b === "number") { return a - b; }
    return String(a).localeCompare(String(b), "en", { numeric: true });
  }
  document.querySelectorAll("button.sort").forEach(function (button) {
    button.addEventListener("click", function () {
      var head = button.closest("th"), table = head.closest("table"), body = table.tBodies[0];
      var index = head.cellIndex, numeric = head.classList.contains("num");
      var now = head.getAttribute("aria-sort");
      // Numbers first from the largest, names first from A.
      var next = now === "none" ? (numeric ? "descending" : "ascending") : now === "ascending" ? "descending" : "ascending";
      table.querySelectorAll("th[aria-sort]").forEach(function (other) { other.setAttribute("aria-sort", "none"); });
      head.setAttribute("aria-sort", next);
      var sign = next === "ascending" ? 1 : -1;
      Array.from(body.rows).map(function (row, place) { return { row: row, place: place, key: key(row, index) }; })
        .sort(function (a, b) {
          if (a.key === null || b.key === null) { return (a.key === null) - (b.key === null) || a.place - b.place; }
          return sign * compare(a.key, b.key) || a.place - b.place;
        })
        .forEach(function (item) { body.appendChild(item.row); });
    });
  });
}());
