// Curves over a common x axis, in panels one above the other, with a picker of panels.

const CHART = { left: 84, right: 16, top: 12, gap: 14, bottom: 46 };

// `spec` as the page's data has it, with decoded arrays: { xLabel, xLog, grids, panels, marks, markMeaning }.
function createChart(host, spec, name) {
  const even = (x) => (spec.xLog ? Math.log(x) : x);
  const back = (x) => (spec.xLog ? Math.exp(x) : x);
  const all = extremes(spec.grids.flatMap((grid) => [grid[0], grid[grid.length - 1]])).map(even);
  if (!(all[1] > all[0])) all[1] = all[0] + 1;
  let view = [...all];
  let cursor = null;

  const picker = element("fieldset", { class: "controls" }, element("legend", {}, "Show"));
  if (spec.panels.length > 1) {
    for (const panel of spec.panels) {
      const box = element("input", { type: "checkbox", checked: panel.shown, onchange: () => {
        panel.shown = box.checked;
        changed();
      } });
      picker.append(element("label", {}, box, panel.name.replaceAll("_", " ")));
    }
  } else {
    picker.firstChild.remove();
  }
  picker.append(element("button", { type: "button", onclick: () => setView([...all]) }, "Reset zoom"));
  const figure = element("div", {
    class: "figure", tabindex: "0", role: "application",
    "aria-label": `${name}. Arrow keys read values, plus and minus zoom, 0 resets.`,
  });
  const legend = element("ul", { class: "legend" });
  const said = element("p", { class: "unseen", "aria-live": "polite" });
  const help = element("p", { class: "help" },
    "Hover to read values, wheel to zoom, drag to move, double-click to reset; or focus and use the arrow keys, + and -.");
  host.append(picker, figure, legend, said, help);

  // Labels of marks stand above the panels, not on the curves.
  const strip = spec.marks.length ? 66 : 0;
  const shown = () => spec.panels.filter((panel) => panel.shown);
  const heights = () => shown().reduce((sum, panel) => sum + panel.height + CHART.gap, 0);
  const { request, canvas } = surface(figure, () => CHART.top + strip + heights() + CHART.bottom, paint);
  const area = () => ({ left: CHART.left, width: figure.clientWidth - CHART.left - CHART.right });
  const atX = (x) => area().left + ((even(x) - view[0]) / (view[1] - view[0])) * area().width;
  const toX = (px) => back(view[0] + ((px - area().left) / area().width) * (view[1] - view[0]));

  function changed() {
    request();
    tell();
  }

  function setView(next) {
    view = next;
    figure.dataset.view = view.map(back).join(" ");
    changed();
  }

  // Indices of a grid's points within the view and one beyond on each side.
  function visible(grid) {
    const from = Math.max(lowerBound(grid, back(view[0])) - 1, 0);
    return [from, Math.min(lowerBound(grid, back(view[1])) + 1, grid.length - 1)];
  }

  function yRange(panel) {
    if (panel.range) return panel.range;
    let low = Infinity, high = -Infinity;
    const take = (value) => {
      if (Number.isFinite(value) && (!panel.log || value > 0)) {
        low = Math.min(low, value);
        high = Math.max(high, value);
      }
    };
    for (const series of panel.series) {
      const [from, to] = visible(spec.grids[series.grid]);
      for (const values of [series.y, series.low, series.high]) {
        if (values) for (let k = from; k <= to; k++) take(values[k]);
      }
    }
    for (const [value] of panel.levels) take(value);
    if (!(low <= high)) [low, high] = panel.log ? [1, 10] : [0, 1];
    if (panel.log) return [low / 1.15, high * 1.15];
    const room = high > low ? 0.05 * (high - low) : 0.05 * Math.max(Math.abs(high), 1);
    return [low - room, high + room];
  }

  function paint(context, width) {
    const box = area();
    let top = CHART.top + strip;
    drawMarkLabels(context, box, top);
    context.lineJoin = "round";
    const panels = shown();
    panels.forEach((panel, index) => {
      const [low, high] = yRange(panel);
      const scale = (y) => (panel.log ? Math.log(y) : y);
      const atY = (y) => top + panel.height * (1 - (scale(y) - scale(low)) / (scale(high) - scale(low)));
      drawFrame(context, panel, box, top, low, high, atY, index === panels.length - 1);
      context.save();
      context.beginPath();
      context.rect(box.left, top, box.width, panel.height);
      context.clip();
      for (const series of panel.series) drawSeries(context, series, atY, box);
      for (const [value] of panel.levels) drawLine(context, box.left, atY(value), box.left + box.width, atY(value), [3, 3], themed("ink"));
      for (const [x] of spec.marks) drawLine(context, atX(x), top, atX(x), top + panel.height, [6, 4], themed("muted"));
      context.restore();
      for (const [x, y, label] of panel.stars) drawStar(context, atX(x), atY(y), label, box, top, panel.height);
      if (cursor !== null) drawLine(context, atX(cursor), top, atX(cursor), top + panel.height, [], themed("accent"));
      top += panel.height + CHART.gap;
    });
    context.fillStyle = themed("ink");
    context.font = `15px ${FONT}`;
    context.textAlign = "center";
    context.fillText(spec.xLabel, box.left + box.width / 2, top - CHART.gap + 40, width);
  }

  // Moved aside where they would cover each other.
  function drawMarkLabels(context, box, top) {
    let free = -Infinity;
    for (const [x, label] of spec.marks) {
      const at = atX(x);
      if (at < box.left || at > box.left + box.width) continue;
      const aside = Math.max(at, free);
      free = aside + 15;
      drawLine(context, at, top, aside, top - 8, [], themed("muted"));
      upright(context, label, aside + 4, top - 11);
    }
  }

  function drawFrame(context, panel, box, top, low, high, atY, last) {
    const bottom = top + panel.height;
    context.font = `13px ${FONT}`;
    context.lineWidth = 1;
    for (const [value, label] of ticks(back(view[0]), back(view[1]), box.width / 90, spec.xLog)) {
      const x = atX(value);
      drawLine(context, x, top, x, bottom, [], themed("faint"));
      context.fillStyle = themed("ink");
      context.textAlign = "center";
      if (last) context.fillText(label, x, bottom + 17);
    }
    for (const [value, label] of ticks(low, high, Math.max(3, panel.height / 40), panel.log)) {
      const y = atY(value);
      drawLine(context, box.left, y, box.left + box.width, y, [], themed("faint"));
      context.fillStyle = themed("ink");
      context.textAlign = "right";
      context.fillText(label, box.left - 7, y + 4.5);
    }
    context.strokeStyle = themed("ink");
    context.strokeRect(box.left, top, box.width, panel.height);
    context.save();
    context.translate(0, top + panel.height / 2);
    context.rotate(-Math.PI / 2);
    context.textAlign = "center";
    const lines = wrapped(context, panel.label, panel.height);
    lines.forEach((line, k) => context.fillText(line, 0, 16 + 16 * k));
    context.restore();
  }

  function drawSeries(context, series, atY, box) {
    const grid = spec.grids[series.grid];
    const [from, to] = visible(grid);
    context.strokeStyle = context.fillStyle = lineColour(series.colour);
    if (series.low) {
      context.beginPath();
      for (let k = from; k <= to; k++) context.lineTo(atX(grid[k]), atY(series.high[k]));
      for (let k = to; k >= from; k--) context.lineTo(atX(grid[k]), atY(series.low[k]));
      context.globalAlpha = 0.35;
      context.fill();
      context.globalAlpha = 1;
    }
    context.globalAlpha = series.alpha ?? 1;
    context.lineWidth = series.width;
    context.setLineDash(series.dashed ? [8, 5] : []);
    context.beginPath();
    const crowded = to - from > 4 * box.width;
    let open = false;
    for (let k = from; k <= to;) {
      if (!Number.isFinite(series.y[k])) {
        open = false;
        k++;
        continue;
      }
      // Of the points in one pixel column, the first, the extremes and the last make the same picture as all.
      let end = k + 1;
      const x = atX(grid[k]);
      let low = series.y[k], high = low, final = low;
      if (crowded) {
        const column = Math.floor(x);
        for (; end <= to && Number.isFinite(series.y[end]) && Math.floor(atX(grid[end])) === column; end++) {
          final = series.y[end];
          low = Math.min(low, final);
          high = Math.max(high, final);
        }
      }
      if (open) context.lineTo(x, atY(series.y[k]));
      else context.moveTo(x, atY(series.y[k]));
      open = true;
      if (end > k + 1) {
        for (const value of [low, high, final]) context.lineTo(x, atY(value));
      }
      k = end;
    }
    context.stroke();
    context.setLineDash([]);
    context.globalAlpha = 1;
  }

  function drawStar(context, x, y, label, box, top, height) {
    if (x < box.left || x > box.left + box.width || y < top || y > top + height) return;
    context.beginPath();
    for (let k = 0; k < 10; k++) {
      const reach = k % 2 ? 4 : 9.5;
      context.lineTo(x + reach * Math.sin((Math.PI * k) / 5), y - reach * Math.cos((Math.PI * k) / 5));
    }
    context.fillStyle = themed("ink");
    context.fill();
    context.textAlign = "right";
    context.font = `bold 13px ${FONT}`;
    context.fillText(label, x - 12, y - 5);
  }

  // The values at the cursor, in the legend.
  function tell() {
    legend.replaceChildren();
    const entries = new Set();
    const words = [];
    if (cursor !== null) {
      words.push(`${spec.xLabel}: ${significant(cursor)}`);
      legend.append(element("li", { "data-x": cursor }, words[0]));
    }
    for (const panel of shown()) {
      for (const series of panel.series) {
        const title = panel.series.length > 1 && spec.panels.length > 1 ? `${panel.name.replaceAll("_", " ")}, ${series.name}` : series.name || panel.label;
        const grid = spec.grids[series.grid];
        const value = cursor === null ? "" : `: ${significant(series.y[nearest(grid, cursor)])}`;
        const sign = element("i");
        sign.style.cssText = `height:0;border-top:3px ${series.dashed ? "dashed" : "solid"} ${lineColour(series.colour)}`;
        // Without a cursor, one entry tells what all curves of a name are.
        const entry = value ? title + value : series.name || panel.label;
        if (!entries.has(entry)) legend.append(element("li", {}, sign, entry));
        entries.add(entry);
        if (value) words.push(entry);
      }
    }
    const swatch = (style) => {
      const made = element("i");
      made.style.cssText = style;
      return made;
    };
    const over = shown().map((panel) => panel.series.at(-1)).find((series) => series?.alpha < 1);
    if (over) {
      const under = shown().find((panel) => panel.series.includes(over)).series.at(-2);
      const mixed = `color-mix(in srgb, ${lineColour(over.colour)} ${100 * over.alpha}%, ${lineColour(under?.colour ?? over.colour)})`;
      legend.append(element("li", {}, swatch(`height:0;border-top:3px solid ${mixed}`), "both, one over the other"));
    }
    const further = new Set(shown().flatMap((panel) => panel.levels.map(([, meaning]) => meaning)));
    for (const meaning of further) legend.append(element("li", {}, swatch("height:0;border-top:2px dotted currentColor"), meaning));
    if (spec.marks.length) legend.append(element("li", {}, swatch("height:0;border-top:2px dashed currentColor"), spec.markMeaning));
    if (shown().some((panel) => panel.stars.length)) legend.append(element("li", {}, "★ resonance speed"));
    said.textContent = words.join("; ");
  }

  function setCursor(x) {
    cursor = x;
    changed();
  }

  let drag = null;
  figure.addEventListener("pointermove", (event) => {
    const px = event.clientX - canvas.getBoundingClientRect().left;
    if (drag) {
      setView(moved(drag.view, ((drag.px - px) / area().width) * (drag.view[1] - drag.view[0]), all));
    } else if (px >= area().left && px <= area().left + area().width) {
      const grid = spec.grids[shown()[0]?.series[0]?.grid ?? 0];
      setCursor(grid[nearest(grid, toX(px))]);
    }
  });
  figure.addEventListener("pointerdown", (event) => {
    drag = { px: event.clientX - canvas.getBoundingClientRect().left, view };
    figure.setPointerCapture(event.pointerId);
  });
  for (const name of ["pointerup", "pointercancel"]) figure.addEventListener(name, () => { drag = null; });
  figure.addEventListener("pointerleave", () => setCursor(null));
  figure.addEventListener("dblclick", () => setView([...all]));
  figure.addEventListener("wheel", (event) => {
    event.preventDefault();
    const px = event.clientX - canvas.getBoundingClientRect().left;
    setView(zoomed(view, Math.exp(0.0015 * event.deltaY), even(toX(px)), all));
  }, { passive: false });
  figure.addEventListener("keydown", (event) => {
    const grid = spec.grids[shown()[0]?.series[0]?.grid ?? 0];
    const [from, to] = visible(grid);
    const stride = (event.shiftKey ? 10 : 1) * Math.max(1, Math.round((to - from) / 200));
    const here = cursor === null ? Math.round((from + to) / 2) : nearest(grid, cursor);
    const step = { ArrowLeft: -stride, ArrowRight: stride }[event.key];
    const centre = cursor === null ? (view[0] + view[1]) / 2 : even(cursor);
    if (step) setCursor(grid[Math.min(Math.max(here + step, 0), grid.length - 1)]);
    else if (event.key === "+" || event.key === "=") setView(zoomed(view, 0.7, centre, all));
    else if (event.key === "-") setView(zoomed(view, 1 / 0.7, centre, all));
    else if (event.key === "0") setView([...all]);
    else return;
    event.preventDefault();
  });
  darkTheme.addEventListener("change", tell);
  tell();
}

function drawLine(context, x0, y0, x1, y1, dash, colour) {
  context.beginPath();
  context.setLineDash(dash);
  context.strokeStyle = colour;
  context.lineWidth = 1;
  context.moveTo(x0, y0);
  context.lineTo(x1, y1);
  context.stroke();
  context.setLineDash([]);
}

function upright(context, text, x, y) {
  context.save();
  context.translate(x, y);
  context.rotate(-Math.PI / 2);
  context.font = `12px ${FONT}`;
  context.textAlign = "left";
  context.fillStyle = themed("ink");
  context.fillText(text, 0, 0);
  context.restore();
}

// At most two lines that fit `room` px if any break does.
function wrapped(context, text, room) {
  if (context.measureText(text).width <= room) return [text];
  for (let k = text.length; k > 0; k--) {
    if (text[k] === " " && context.measureText(text.slice(0, k)).width <= room) return [text.slice(0, k), text.slice(k + 1)];
  }
  return [text];
}

function extremes(values) {
  return [Math.min(...values), Math.max(...values)];
}

function lowerBound(sorted, value) {
  let low = 0, high = sorted.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (sorted[middle] < value) low = middle + 1;
    else high = middle;
  }
  return low;
}

function nearest(sorted, value) {
  const after = Math.min(lowerBound(sorted, value), sorted.length - 1);
  const before = Math.max(after - 1, 0);
  return value - sorted[before] < sorted[after] - value ? before : after;
}

// The page's chart with its arrays decoded.
function decodedChart(chart) {
  const series = (one) => ({ ...one, y: floats(one.y), low: one.low && floats(one.low), high: one.high && floats(one.high) });
  return {
    ...chart,
    grids: chart.grids.map(floats),
    panels: chart.panels.map((panel) => ({ ...panel, series: panel.series.map(series) })),
  };
}
