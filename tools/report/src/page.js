// Values under the pointer, and zoom: drag over a plot, double-click or Escape for the whole plot.
// The page is complete without this script. Each drawing states its plots in `data-plots`.
(() => {
  "use strict";
  const NS = "http://www.w3.org/2000/svg";
  const create = (name, parent, attributes = {}, before = null) => {
    const node = document.createElementNS(NS, name);
    for (const key in attributes) node.setAttribute(key, attributes[key]);
    return parent.insertBefore(node, before);
  };
  const tip = document.body.appendChild(document.createElement("output"));
  tip.className = "tip";
  tip.hidden = true;

  // a value with the digits that the drawing resolves
  const shown = (place, step, log) => {
    const value = log ? 10 ** place : place;
    const digits = log ? 4 : Math.max(1, Math.ceil(Math.log10(Math.abs(value) / step) + 1));
    return String(Number(value.toPrecision(Math.min(digits || 1, 12))));
  };
  const steps = (low, high, count) => {
    const raw = (high - low) / count, power = 10 ** Math.floor(Math.log10(raw));
    const step = [1, 2, 5, 10].find(k => k * power >= raw) * power;
    const ticks = [];
    for (let k = Math.ceil(low / step); k * step <= high; k++) ticks.push([k * step, step]);
    return ticks;
  };
  // ticks of an axis: places, and their numbers
  const ticks = (low, high, count, log) => {
    if (!log) return steps(low, high, count).map(([v, step]) => [v, shown(v, step / 10)]);
    if (high - low > 1.5) return steps(low, high, Math.min(count, high - low)).filter(([v]) =>
      Number.isInteger(Number(v.toFixed(6)))).map(([v]) => [v, shown(v, 0, true)]);
    return steps(10 ** low, 10 ** high, count).filter(([v]) => v > 0)
      .map(([v, step]) => [Math.log10(v), shown(v, step / 10)]);
  };

  class Plot {
    constructor(svg, number, { at, x, y, curves, bands }) {
      Object.assign(this, { svg, at, axes: [x, y], curves, bands, shapes: [], labels: [] });
      [this.left, this.top, this.wide, this.high] = at;
      this.whole = this.axes.map(a => [a.low, a.high]);
      this.view = this.whole;
      for (const node of svg.querySelectorAll("polyline, polygon, path.dots")) {
        const curve = node.tagName === "polygon" ? -1
          : curves.findIndex(c => c.colour === node.getAttribute("stroke"));
        const dots = node.tagName === "path";
        const points = dots
          ? [...node.getAttribute("d").matchAll(/M(\S+) (\S+?)h0/g)].map(([, x, y]) => [+x, +y])
          : node.getAttribute("points").trim().split(" ").map(p => p.split(",").map(Number));
        const [[px, py], [qx, qy]] = [points[0], points.at(-1)];
        if (node.getAttribute("stroke") === "#666666" && Math.abs(px - qx) + Math.abs(py - qy) < 20
          && this.holds([px, py], 24)) this.labels.push(node);
        else if ((curve >= 0 || node.tagName === "polygon") && this.holds([px, py], 3))
          this.shapes.push({ node, curve, dots, points: points.map(p => this.value(p)) });
      }
      for (const node of svg.querySelectorAll("line, text")) {
        const [px, py] = ["x", "y"].map(k => +(node.getAttribute(k) || node.getAttribute(k + "1")));
        const number = node.tagName === "text" && /^[-\d.e]+$/.test(node.textContent.trim());
        const below = py > this.top + this.high && py < this.top + this.high + 85
          && px > this.left - 40 && px < this.left + this.wide + 40;
        const beside = px < this.left && px > this.left - 330 && py > this.top - 9
          && py < this.top + this.high + 9 && node.getAttribute("text-anchor") === "end";
        if (node.tagName === "line" ? this.holds([px, py], 3) : number && (below || beside))
          this.labels.push(node);
      }
      this.clip = `plot-${number}`;
      create("rect", create("clipPath", svg, { id: this.clip }),
        { x: this.left, y: this.top, width: this.wide, height: this.high });
    }
    holds([x, y], margin) {
      return x >= this.left - margin && x <= this.left + this.wide + margin
        && y >= this.top - margin && y <= this.top + this.high + margin;
    }
    // the place on the axes of a point of the drawing, and the reverse
    value([px, py]) {
      const [[a, b], [c, d]] = this.view;
      return [a + (px - this.left) / this.wide * (b - a), d - (py - this.top) / this.high * (d - c)];
    }
    pixel([x, y]) {
      const [[a, b], [c, d]] = this.view;
      return [this.left + (x - a) / (b - a) * this.wide, this.top + (d - y) / (d - c) * this.high];
    }
    zoom(view) {
      this.view = view || this.whole;
      for (const { node, dots, points } of this.shapes) {
        const at = points.map(p => this.pixel(p).map(v => v.toFixed(1)));
        if (dots) node.setAttribute("d", at.map(p => `M${p.join(" ")}h0`).join(""));
        else node.setAttribute("points", at.map(p => p.join(",")).join(" "));
        node.setAttribute("clip-path", `url(#${this.clip})`);
      }
      this.labels.forEach(node => { node.style.display = view ? "none" : ""; });
      this.grid?.remove();
      this.grid = null;
      if (view) this.drawTicks();
    }
    drawTicks() {
      const [x, y] = this.axes, [[a, b], [c, d]] = this.view;
      this.grid = create("g", this.svg, { "font-family": "sans-serif", "font-size": 44, fill: "#222" },
        this.shapes[0]?.node);
      const [right, bottom] = [this.left + this.wide, this.top + this.high];
      const mark = (x1, y1, x2, y2, anchor, text, dx, dy) => {
        create("line", this.grid, { x1, y1, x2, y2, stroke: "#DCDCDC", "stroke-width": 3 });
        create("text", this.grid, { x: x1 + dx, y: y1 + dy, "text-anchor": anchor }).textContent = text;
      };
      for (const [v, text] of ticks(a, b, this.wide / 260, x.log)) {
        const px = this.pixel([v, c])[0];
        mark(px, bottom, px, this.top, "middle", text, 0, 56);
      }
      for (const [v, text] of ticks(c, d, this.high / 130, y.log)) {
        const py = this.pixel([a, v])[1];
        mark(this.left, py, right, py, "end", text, -26, 15);
      }
    }
    // values at the place x: of lines and bands between their points, of dots the nearest
    values(shape, x, reach) {
      if (shape.dots) return shape.points.filter(p => Math.abs(p[0] - x) <= reach);
      const found = [];
      shape.points.slice(1).forEach((q, k) => {
        const p = shape.points[k];
        if ((p[0] - x) * (q[0] - x) > 0 || p[0] === q[0]) return;
        found.push([x, p[1] + (x - p[0]) / (q[0] - p[0]) * (q[1] - p[1])]);
      });
      return found;
    }
    // what the tooltip shows of a point of the drawing
    describe(at) {
      const [x, y] = this.axes, here = this.value(at);
      const step = this.view.map(([low, high], k) => (high - low) / this.at[2 + k]);
      const text = v => shown(v, step[1], y.log);
      const lines = [];
      if (x.map) {
        lines.push(`${x.label}: ${shown(here[0], step[0])}`, `${y.label}: ${text(here[1])}`);
        return lines.join("\n");
      }
      lines.push(`${x.label}: ${shown(here[0], step[0], x.log)}`);
      this.curves.forEach(({ name }, k) => {
        const found = this.shapes.filter(s => s.curve === k)
          .flatMap(s => this.values(s, here[0], 12 * step[0]));
        const gap = p => Math.abs(p[0] - here[0]);
        if (!found.length) return;
        const best = found.reduce((a, b) => gap(b) < gap(a) ? b : a);
        lines.push(`${name || y.label}: ${text(best[1])}`);
      });
      const edges = this.shapes.filter(s => s.curve < 0).flatMap(s => this.values(s, here[0], 0));
      if (edges.length) {
        const v = edges.map(p => p[1]);
        lines.push(`${this.bands[0]}: ${text(Math.min(...v))} to ${text(Math.max(...v))}`);
      }
      return lines.join("\n");
    }
  }

  const all = [];
  document.querySelectorAll("svg[data-plots]").forEach(svg => {
    const plots = JSON.parse(svg.dataset.plots).map(p => all[all.push(new Plot(svg, all.length, p)) - 1]);
    let drag = null, box = null, cursor = null;
    const place = e => {
      const p = new DOMPoint(e.clientX, e.clientY).matrixTransform(svg.getScreenCTM().inverse());
      return [p.x, p.y];
    };
    const clear = () => { box?.remove(); cursor?.remove(); box = cursor = null; tip.hidden = true; };
    svg.addEventListener("pointermove", e => {
      const at = place(e);
      clear();
      if (drag) {
        const [a, b] = [drag.from, at];
        const flat = Math.abs(b[1] - a[1]) < 40;
        const [top, high] = flat ? [drag.plot.top, drag.plot.high]
          : [Math.min(a[1], b[1]), Math.abs(b[1] - a[1])];
        box = create("rect", svg, { x: Math.min(a[0], b[0]), y: top, width: Math.abs(b[0] - a[0]),
          height: high, fill: "#0072B2", opacity: 0.2 });
        return;
      }
      const plot = plots.find(p => p.holds(at, 0));
      if (!plot?.shapes.length) return;
      cursor = create("line", svg, { x1: at[0], x2: at[0], y1: plot.top,
        y2: plot.top + plot.high, stroke: "#666", "stroke-width": 3 });
      tip.textContent = plot.describe(at);
      tip.hidden = false;
      tip.style.top = `${e.pageY + 14}px`;
      const room = document.documentElement.clientWidth - tip.offsetWidth - 8;
      tip.style.left = `${Math.max(0, Math.min(e.pageX + 14, room))}px`;
    });
    svg.addEventListener("pointerdown", e => {
      const from = place(e), plot = plots.find(p => p.holds(from, 0));
      if (plot && e.button === 0 && e.pointerType !== "touch") {
        drag = { plot, from };
        e.preventDefault();
      }
    });
    addEventListener("pointerup", e => {
      if (!drag) return;
      const { plot, from } = drag, to = place(e);
      drag = null;
      clear();
      if (Math.abs(to[0] - from[0]) < 40) return;
      const flat = Math.abs(to[1] - from[1]) < 40;
      const [a, b] = [from, to].map(p => plot.value(p));
      const range = k => [Math.max(Math.min(a[k], b[k]), plot.view[k][0]),
        Math.min(Math.max(a[k], b[k]), plot.view[k][1])];
      plot.zoom([range(0), flat ? plot.view[1] : range(1)]);
    });
    svg.addEventListener("pointerleave", () => { if (!drag) clear(); });
    svg.addEventListener("dblclick", e => plots.find(p => p.holds(place(e), 0))?.zoom(null));
  });
  addEventListener("keydown", e => { if (e.key === "Escape") all.forEach(p => p.zoom(null)); });
  // a page is printed as it was written
  addEventListener("beforeprint", () => all.forEach(p => p.zoom(null)));
})();
