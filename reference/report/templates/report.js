"use strict";
(() => {
  const all = (selector, from = document) => [...from.querySelectorAll(selector)];
  const root = document.documentElement;

  // The look: the system's, until the button says otherwise; kept where the browser lets a file keep anything.
  const theme = document.getElementById("theme");
  const system = matchMedia("(prefers-color-scheme: dark)");
  const isDark = () => (root.dataset.theme ? root.dataset.theme === "dark" : system.matches);
  const showTheme = () => theme.setAttribute("aria-pressed", String(isDark()));
  try {
    const kept = localStorage.getItem("theme");
    if (kept === "dark" || kept === "light") root.dataset.theme = kept;
  } catch { /* private windows keep nothing */ }
  theme.addEventListener("click", () => {
    root.dataset.theme = isDark() ? "light" : "dark";
    try { localStorage.setItem("theme", root.dataset.theme); } catch { /* as above */ }
    showTheme();
  });
  system.addEventListener("change", showTheme);
  showTheme();

  // Swapping: hover and keyboard focus show the other side's picture in place, a press keeps it there.
  for (const pair of all(".trio")) {
    const buttons = all(".swap", pair);
    const sources = buttons.map((button) => button.querySelector("img").src);
    buttons.forEach((button, k) => {
      const image = button.querySelector("img");
      const tag = button.querySelector(".tag");
      const show = (other) => {
        image.decoding = "sync";
        image.src = sources[other ? 1 - k : k];
        tag.textContent = other ? tag.dataset.there : tag.dataset.here;
        button.classList.toggle("swapped", other);
      };
      const pressed = () => button.getAttribute("aria-pressed") === "true";
      button.addEventListener("pointerenter", (event) => { if (event.pointerType === "mouse") show(!pressed()); });
      button.addEventListener("pointerleave", () => show(pressed()));
      button.addEventListener("focus", () => { if (button.matches(":focus-visible")) show(!pressed()); });
      button.addEventListener("blur", () => show(pressed()));
      button.addEventListener("click", () => {
        button.setAttribute("aria-pressed", String(!pressed()));
        show(pressed());
      });
    });
  }

  // Commands to the clipboard; where a browser refuses, the text is selected instead.
  for (const button of all(".copy")) {
    const code = button.parentElement.querySelector("code");
    button.addEventListener("click", async () => {
      try {
        await navigator.clipboard.writeText(code.textContent);
        button.textContent = "Copied";
      } catch {
        getSelection().selectAllChildren(code);
        button.textContent = "Selected";
      }
      setTimeout(() => { button.textContent = "Copy"; }, 1500);
    });
  }

  // The filter: every word has to be in the row.
  const filter = document.getElementById("filter");
  if (filter) {
    const rows = all("#rows tr").map((row) => [row, [...row.cells].map((cell) => cell.textContent).join(" ").toLowerCase()]);
    const shown = document.getElementById("shown");
    const apply = () => {
      const words = filter.value.toLowerCase().split(/\s+/).filter(Boolean);
      let count = 0;
      for (const [row, text] of rows) {
        row.hidden = !words.every((word) => text.includes(word));
        count += !row.hidden;
      }
      shown.textContent = `${count.toLocaleString("en-US")} of ${rows.length.toLocaleString("en-US")}`;
    };
    filter.addEventListener("input", apply);
    for (const link of all(".filter-link")) {
      link.addEventListener("click", () => {
        document.getElementById("all").open = true;
        filter.value = link.dataset.filter;
        apply();
      });
    }
  }

  // A link to a scene opens it.
  const open = () => {
    const target = location.hash && document.getElementById(decodeURIComponent(location.hash.slice(1)));
    if (target instanceof HTMLDetailsElement) {
      target.open = true;
      target.scrollIntoView();
    }
  };
  addEventListener("hashchange", open);
  open();

  const unfold = document.getElementById("unfold");
  if (unfold) {
    unfold.addEventListener("click", () => {
      const opening = unfold.getAttribute("aria-pressed") !== "true";
      for (const scene of all("details.scene")) scene.open = opening;
      unfold.setAttribute("aria-pressed", String(opening));
      unfold.textContent = opening ? "Close all" : "Open all";
    });
  }
})();
