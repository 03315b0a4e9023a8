// Small helpers for the page's elements.

export const $ = (id) => document.getElementById(id);

/** Set text only where it changed: twenty frames a second must not lay the page out again. */
export function text(element, value) {
  const words = String(value);
  if (element.textContent !== words) element.textContent = words;
}

export function show(element, visible) {
  if (element.hidden === visible) element.hidden = !visible;
}

export function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name in element && typeof value !== "string") element[name] = value;
    else element.setAttribute(name, value);
  }
  element.append(...children);
  return element;
}

/** A row of radio buttons drawn as one control; `choose(value)` is called with what was clicked. */
export function choice(holder, options, choose) {
  holder.replaceChildren(
    ...options.map(([value, label]) => {
      const button = make("button", { type: "button", role: "radio", "aria-checked": "false" }, label);
      button.dataset.value = String(value);
      button.addEventListener("click", () => choose(value));
      return button;
    }),
  );
  holder.onkeydown = (event) => {
    const step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
    if (!step) return;
    const buttons = [...holder.children];
    const next = buttons[(buttons.indexOf(event.target) + step + buttons.length) % buttons.length];
    next.focus();
    next.click();
    event.preventDefault();
    event.stopPropagation();
  };
}

export function chosen(holder, value) {
  for (const button of holder.children) {
    const on = button.dataset.value === String(value);
    if (button.getAttribute("aria-checked") !== String(on)) {
      button.setAttribute("aria-checked", String(on));
      button.tabIndex = on ? 0 : -1;
    }
  }
}

/** Words of a name: `drawer_open` becomes "drawer open". */
export const words = (name) => name.replaceAll("_", " ");

/** Local settings that may be missing or forbidden (private windows). */
export const settings = {
  get(name, otherwise) {
    try {
      return JSON.parse(localStorage.getItem(`kitchen.${name}`)) ?? otherwise;
    } catch {
      return otherwise;
    }
  },
  set(name, value) {
    try {
      localStorage.setItem(`kitchen.${name}`, JSON.stringify(value));
    } catch {
      // Settings last as long as the page then.
    }
  },
};
