"use strict";
(() => {
  const main = document.getElementById("now"), link = document.getElementById("link");
  const lost = document.getElementById("lost"), { every, silent } = document.body.dataset;
  let seen = "", held = false, waiting = null;

  function put(told) {
    if (held) { waiting = told; return; }
    const open = [...main.querySelectorAll("details[open]")].map((part) => part.id);
    const focus = document.activeElement && document.activeElement.id;
    const place = main.querySelector(".events"), scroll = place ? place.scrollTop : 0;
    main.innerHTML = told.main;
    document.title = told.title;
    for (const id of open) { const part = document.getElementById(id); if (part) part.open = true; }
    const again = focus && document.getElementById(focus);
    if (again) again.focus({ preventScroll: true });
    if (main.querySelector(".events")) main.querySelector(".events").scrollTop = scroll;
  }

  async function look() {
    try {
      const answer = await fetch("now", { signal: AbortSignal.timeout(Number(silent)) });
      if (!answer.ok) throw new Error(answer.statusText);
      const told = await answer.json();
      lost.hidden = true;
      link.innerHTML = told.link;
      if (told.main !== seen) { seen = told.main; put(told); }
    } catch {
      lost.hidden = false;
    }
    setTimeout(look, Number(every));
  }

  // A button must not be replaced under the finger that presses it.
  main.addEventListener("pointerdown", () => { held = true; });
  for (const end of ["pointerup", "pointercancel"]) {
    addEventListener(end, () => setTimeout(() => {
      held = false;
      if (waiting) { const told = waiting; waiting = null; put(told); }
    }, 100));
  }

  main.addEventListener("submit", async (event) => {
    event.preventDefault();
    const form = event.target, button = form.querySelector("button");
    button.disabled = true;
    try {
      const answer = await fetch(form.getAttribute("action"), { method: "POST",
        body: new URLSearchParams(new FormData(form)), headers: { Accept: "application/json" } });
      if (!answer.ok) throw new Error(answer.statusText);
    } catch {
      button.disabled = false;
      button.textContent = "Not acknowledged: try again";
    }
  });

  look();
})();
