(function () {
  "use strict";
  var articles = Array.prototype.slice.call(document.querySelectorAll("article"));
  var search = document.getElementById("search"), count = document.getElementById("count");
  var none = document.getElementById("none"), large = document.getElementById("large");
  var selects = Array.prototype.slice.call(document.querySelectorAll("select[data-filter]"));
  var before = window.matchMedia("(max-width: 48rem)").matches;
  document.querySelector(".more").open = !before;

  // Pictures lie in the page as text and are decoded when they come near the window.
  function load(image) {
    var data = document.getElementById("picture-" + image.dataset.picture);
    if (data && !image.src) { image.src = "data:image/webp;base64," + data.textContent; }
  }
  var watcher = new IntersectionObserver(function (seen) {
    seen.forEach(function (entry) {
      if (entry.isIntersecting) { load(entry.target); watcher.unobserve(entry.target); }
    });
  }, { rootMargin: "600px" });
  document.querySelectorAll("img[data-picture]").forEach(function (image) { watcher.observe(image); });

  function state() {
    var wanted = {};
    if (search.value.trim()) { wanted.q = search.value.trim(); }
    selects.forEach(function (select) { if (select.value) { wanted[select.dataset.filter] = select.value; } });
    return wanted;
  }
  function fits(article, wanted) {
    return Object.keys(wanted).every(function (name) {
      if (name === "q") {
        return wanted.q.toLowerCase().split(/\s+/).every(function (word) {
          return article.dataset.search.indexOf(word) >= 0;
        });
      }
      return article.dataset[name].split("|").indexOf(wanted[name]) >= 0;
    });
  }
  function show(keep) {
    var wanted = state(), left = 0;
    articles.forEach(function (article) {
      article.hidden = !fits(article, wanted);
      left += article.hidden ? 0 : 1;
    });
    count.textContent = String(left);
    none.hidden = left > 0;
    if (keep) { return; }
    // A link to what is shown now; of files some browsers refuse it.
    try { history.replaceState(null, "", Object.keys(wanted).length ? "#?" + new URLSearchParams(wanted) : "#"); }
    catch (error) { /* the page works without it */ }
  }
  function restore() {
    if (location.hash.indexOf("#?") !== 0) { return; }
    var wanted = new URLSearchParams(location.hash.slice(2));
    search.value = wanted.get("q") || "";
    selects.forEach(function (select) { select.value = wanted.get(select.dataset.filter) || ""; });
    show(true);
  }
  function clear() {
    search.value = "";
    selects.forEach(function (select) { select.value = ""; });
    show(false);
    search.focus();
  }
  search.addEventListener("input", function () { show(false); });
  selects.forEach(function (select) { select.addEventListener("change", function () { show(false); }); });
  document.getElementById("clear").addEventListener("click", clear);
  document.getElementById("clear-all").addEventListener("click", clear);
  window.addEventListener("hashchange", restore);
  document.addEventListener("keydown", function (event) {
    var writing = /^(INPUT|SELECT|TEXTAREA)$/.test(document.activeElement.tagName);
    if (event.key === "/" && !writing) { event.preventDefault(); search.focus(); }
  });
  document.querySelectorAll(".strip").forEach(function (button) {
    button.addEventListener("click", function () {
      var image = button.querySelector("img");
      load(image);
      var shown = large.querySelector("img");
      shown.src = image.src;
      shown.alt = image.alt;
      large.showModal();
    });
  });
  restore();
})();
