// Charts answer the pointer and open large: no library, no network. Without scripts the page says the same.
"use strict";
(() => {
  const tip = document.createElement("div");
  tip.className = "tip";
  tip.hidden = true;
  document.body.append(tip);
  const printed = (v) => (Math.abs(v) >= 1e5 || (v && Math.abs(v) < 1e-3) ? v.toExponential(3) : +v.toPrecision(5)).toString().replace("-", "−");
  const vertices = (svg) => svg.vertices ??= [...svg.querySelectorAll("[data-name] circle, [data-name] rect, path.line[data-name], g circle, g rect, g path")].flatMap((mark) => {
    const name = mark.closest("[data-name]")?.dataset.name ?? "";
    if (mark.classList.contains("line")) return [...mark.getAttribute("d").matchAll(/[ML](-?[\d.]+) (-?[\d.]+)/g)].map((m) => ({x: +m[1], y: +m[2], name, mark}));
    const box = mark.getBBox();
    return [{x: box.x + box.width / 2, y: box.y + box.height / 2, name, mark}];
  });
  const value = (low, high, share, log) => { const v = low + share * (high - low); return log ? 10 ** v : v; };
  const hover = (event) => {
    const svg = event.currentTarget, [x0, x1, y0, y1, left, top, wide, high, logX, logY] = svg.dataset.axes.split(" ").map((v) => v === "True" ? 1 : v === "False" ? 0 : +v);
    const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
    let best = null, near = 24 ** 2;
    for (const v of vertices(svg)) { const d = (v.x - at.x) ** 2 + (v.y - at.y) ** 2; if (d < near) { near = d; best = v; } }
    svg.querySelector(".cross")?.remove();
    if (!best) { tip.hidden = true; return; }
    const [xWords, yWords] = svg.dataset.words.split("|");
    const own = best.mark.querySelector?.("title")?.textContent;
    const pair = `${xWords || "x"}: ${printed(value(x0, x1, (best.x - left) / wide, logX))}   ${yWords || "y"}: ${printed(value(y0, y1, (top + high - best.y) / high, logY))}`;
    tip.textContent = own || (best.name ? `${best.name}   ${pair}` : pair);
    tip.hidden = false;
    tip.style.left = `${Math.min(event.clientX + 14, innerWidth - tip.offsetWidth - 8)}px`;
    tip.style.top = `${Math.max(event.clientY - tip.offsetHeight - 12, 4)}px`;
    const cross = document.createElementNS("http://www.w3.org/2000/svg", "path");
    cross.setAttribute("class", "cross");
    cross.setAttribute("d", `M${best.x} ${top}v${high}M${left} ${best.y}h${wide}`);
    svg.append(cross);
  };
  const leave = (event) => { tip.hidden = true; event.currentTarget.querySelector(".cross")?.remove(); };
  const open = (original) => {
    const pane = document.createElement("dialog"), svg = original.cloneNode(true), full = svg.getAttribute("viewBox").split(" ").map(Number);
    let view = [...full], held = null;
    const set = () => svg.setAttribute("viewBox", view.join(" "));
    pane.className = "large";
    pane.append(svg);
    document.body.append(pane);
    pane.append(tip);
    listen(svg);
    svg.addEventListener("wheel", (e) => {
      e.preventDefault();
      const at = new DOMPoint(e.clientX, e.clientY).matrixTransform(svg.getScreenCTM().inverse());
      const f = Math.min(Math.exp(e.deltaY / 400), full[2] / view[2]);
      view = [at.x - (at.x - view[0]) * f, at.y - (at.y - view[1]) * f, view[2] * f, view[3] * f];
      set();
    }, {passive: false});
    svg.addEventListener("pointerdown", (e) => { held = [e.clientX, e.clientY, ...view]; svg.setPointerCapture(e.pointerId); });
    svg.addEventListener("pointermove", (e) => {
      if (!held) return;
      const scale = svg.getScreenCTM().a;
      view[0] = held[2] - (e.clientX - held[0]) / scale; view[1] = held[3] - (e.clientY - held[1]) / scale;
      set();
    });
    svg.addEventListener("pointerup", () => { held = null; });
    svg.addEventListener("dblclick", () => { view = [...full]; set(); });
    pane.addEventListener("click", (e) => { if (e.target === pane) pane.close(); });
    pane.addEventListener("close", () => { document.body.append(tip); tip.hidden = true; pane.remove(); });
    pane.showModal();
  };
  const listen = (svg) => { if (svg.dataset.axes) { svg.addEventListener("pointermove", hover); svg.addEventListener("pointerleave", leave); } };
  for (const svg of document.querySelectorAll("figure svg")) {
    listen(svg);
    svg.addEventListener("click", () => open(svg));
  }
  document.documentElement.dataset.charts = document.querySelectorAll("figure svg").length;
})();
