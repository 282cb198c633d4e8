// Curves over a common x axis, in panels one above the other, with a picker of panels.

const CHART = { left: 84, right: 16, top: 12, gap: 14, bottom: 46 };

// A line, a panel and a chart of what the page itself finds: linear axes, one grid, no marks.
function plainLine(name, colour, y, alpha = 1) {
  return { name, colour, alpha, grid: 0, width: 1.3, dashed: false, y };
}

function plainPanel(name, words, unit, shown, series, height = 150) {
  return { name, words, unit, shown, log: false, ticks: null, range: null, height, series,
    levels: [], stars: [], mixed: [] };
}

function plainChart(xWords, xUnit, grid, panels) {
  return { xWords, xUnit, xLog: false, xTicks: null, grids: [grid], panels, marks: [],
    markMeaning: "", shades: [], shadeMeaning: "" };
}

// `spec` as the page's data has it, with decoded arrays: { xWords, xUnit, xLog, xTicks, grids,
// panels, marks, markMeaning, shades, shadeMeaning }.
// `pick` hears of the x of a click, and of Enter.
function createChart(host, spec, name, pick = () => {}) {
  const even = (x) => (spec.xLog ? Math.log(x) : x);
  const back = (x) => (spec.xLog ? Math.exp(x) : x);
  const ends = spec.grids.flatMap((grid) => [grid[0], grid[grid.length - 1]]);
  const all = extremes(ends).map(even);
  if (!(all[1] > all[0])) all[1] = all[0] + 1;
  let view = [...all];
  let cursor = null;
  // Where the pointer reads, px from the figure's top; null where keys do.
  let readAt = null;

  const zoomBy = (factor, centre) => setView(zoomed(view, factor, centre, all));
  const centre = () => (cursor === null ? (view[0] + view[1]) / 2 : even(cursor));
  const picker = element("fieldset", { class: "controls" }, element("legend", {}, "Show"));
  if (spec.panels.length > 1) {
    for (const panel of spec.panels) {
      const box = element("input", { type: "checkbox", checked: panel.shown, onchange: () => {
        panel.shown = box.checked;
        changed();
      } });
      picker.append(element("label", {}, box, capitalised(panel.words)));
    }
  } else {
    picker.firstChild.remove();
  }
  picker.append(zoomButtons((factor) => zoomBy(factor, centre()), () => setView([...all])));
  const figure = element("div", {
    class: "figure", tabindex: "0", role: "application",
    "aria-label": `${name}. Arrow keys read values, plus and minus zoom, 0 resets.`,
  });
  const tip = element("div", { class: "tip", hidden: true });
  const legend = element("ul", { class: "legend" });
  const said = element("p", { class: "unseen", "aria-live": "polite" });
  const help = element("p", { class: "help" }, "Hover or tap to read values; zoom by the buttons, "
    + "or by the wheel with Ctrl held; drag to move; double-click to reset. Or focus the figure "
    + "and use the arrow keys, + and -.");
  host.append(picker, figure, legend, said, help);

  // Labels of marks stand above the panels, not on the curves.
  const strip = spec.marks.length ? 66 : 0;
  const shown = () => spec.panels.filter((panel) => panel.shown);
  const heights = () => shown().reduce((sum, panel) => sum + panel.height + CHART.gap, 0);
  const height = () => CHART.top + strip + heights() + CHART.bottom;
  const { request, canvas } = surface(figure, height, paint);
  figure.append(tip);
  const area = () => ({
    left: CHART.left, width: figure.clientWidth - CHART.left - CHART.right,
  });
  const atX = (x) => area().left + ((even(x) - view[0]) / (view[1] - view[0])) * area().width;
  const toX = (px) => back(view[0] + ((px - area().left) / area().width) * (view[1] - view[0]));

  function changed() {
    request();
    tellLegend();
    tell();
  }

  function setView(next) {
    view = next;
    figure.dataset.view = view.map(back).join(" ");
    changed();
  }

  const isWhole = () => view[0] <= all[0] && view[1] >= all[1];

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
      const part = (y) => (scale(y) - scale(low)) / (scale(high) - scale(low));
      const atY = (y) => top + panel.height * (1 - part(y));
      const [right, bottom] = [box.left + box.width, top + panel.height];
      drawFrame(context, panel, box, top, low, high, atY, index === panels.length - 1);
      context.save();
      context.beginPath();
      context.rect(box.left, top, box.width, panel.height);
      context.clip();
      for (const [ranges, colour] of [[spec.shades, SHADE], [panel.mixed, MIXED]]) {
        context.fillStyle = colour;
        for (const [from, to] of ranges) {
          context.fillRect(atX(from), top, Math.max(atX(to) - atX(from), 1), panel.height);
        }
      }
      for (const series of panel.series) drawSeries(context, series, atY, box);
      for (const [value] of panel.levels) {
        drawLine(context, box.left, atY(value), right, atY(value), [3, 3], themed("ink"));
      }
      for (const [x] of spec.marks) {
        drawLine(context, atX(x), top, atX(x), bottom, [6, 4], themed("muted"));
      }
      context.restore();
      for (const [x, y, label] of panel.stars) {
        drawStar(context, atX(x), atY(y), label, box, top, panel.height);
      }
      if (cursor !== null) {
        drawLine(context, atX(cursor), top, atX(cursor), bottom, [], themed("accent"));
      }
      top += panel.height + CHART.gap;
    });
    context.fillStyle = themed("ink");
    context.font = `15px ${FONT}`;
    context.textAlign = "center";
    const at = [box.left + box.width / 2, top - CHART.gap + 40];
    context.fillText(withUnit(spec.xWords, spec.xUnit), ...at, width);
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
    const range = view.map(back);
    for (const [value, label] of ticks(...range, box.width / 90, spec.xTicks)) {
      const x = atX(value);
      drawLine(context, x, top, x, bottom, [], themed("faint"));
      context.fillStyle = themed("ink");
      context.textAlign = "center";
      if (last) context.fillText(label, x, bottom + 17);
    }
    for (const [value, label] of ticks(low, high, Math.max(3, panel.height / 40), panel.ticks)) {
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
    const lines = wrapped(context, withUnit(panel.words, panel.unit), panel.height);
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
    if (series.dots) {
      for (let k = from; k <= to; k++) {
        if (!Number.isFinite(series.y[k])) continue;
        context.beginPath();
        context.arc(atX(grid[k]), atY(series.y[k]), series.width / 2, 0, 2 * Math.PI);
        context.fill();
      }
      return;
    }
    context.globalAlpha = series.alpha ?? 1;
    context.lineWidth = series.width;
    context.setLineDash(series.dashed ? [8, 5] : []);
    context.beginPath();
    const crowded = to - from > 4 * box.width;
    let open = false;
    const dots = [];
    for (let k = from; k <= to;) {
      if (!Number.isFinite(series.y[k])) {
        open = false;
        k++;
        continue;
      }
      // Of the points in one pixel column, the first, the extremes and the last make the same
      // picture as all.
      let end = k + 1;
      const x = atX(grid[k]);
      let low = series.y[k], high = low, final = low;
      if (crowded) {
        const column = Math.floor(x);
        const alike = (at) => Number.isFinite(series.y[at]) && Math.floor(atX(grid[at])) === column;
        for (; end <= to && alike(end); end++) {
          final = series.y[end];
          low = Math.min(low, final);
          high = Math.max(high, final);
        }
      }
      const alone = !open && !(end <= to && Number.isFinite(series.y[end]));
      if (open) context.lineTo(x, atY(series.y[k]));
      else context.moveTo(x, atY(series.y[k]));
      // No line runs to it.
      if (alone) dots.push([x, atY(series.y[k])]);
      open = true;
      if (end > k + 1) {
        for (const value of [low, high, final]) context.lineTo(x, atY(value));
      }
      k = end;
    }
    context.stroke();
    context.setLineDash([]);
    for (const [x, y] of dots) {
      context.beginPath();
      context.arc(x, y, 3, 0, 2 * Math.PI);
      context.fill();
    }
    context.globalAlpha = 1;
  }

  function drawStar(context, x, y, label, box, top, height) {
    if (x < box.left || x > box.left + box.width || y < top || y > top + height) return;
    context.beginPath();
    for (let k = 0; k < 10; k++) {
      const [reach, angle] = [k % 2 ? 4 : 9.5, (Math.PI * k) / 5];
      context.lineTo(x + reach * Math.sin(angle), y - reach * Math.cos(angle));
    }
    context.fillStyle = themed("ink");
    context.fill();
    context.textAlign = "right";
    context.font = `bold 13px ${FONT}`;
    context.fillText(label, x - 12, y - 5);
  }

  const swatch = (style) => {
    const made = element("i");
    made.style.cssText = style;
    return made;
  };
  const lineSign = (series) => swatch(series.dots
    ? `width:9px;height:9px;border-radius:5px;margin:0 9px;background:${lineColour(series.colour)}`
    : `height:0;border-top:3px ${series.dashed ? "dashed" : "solid"} ${lineColour(series.colour)}`);

  // What lines and marks are.
  function tellLegend() {
    const entries = new Map();
    const add = (text, sign) => {
      if (!entries.has(text)) entries.set(text, element("li", {}, ...(sign ? [sign] : []), text));
    };
    for (const panel of shown()) {
      for (const series of panel.series) add(series.name || panel.words, lineSign(series));
    }
    const over = shown().map((panel) => panel.series.at(-1)).find((series) => series?.alpha < 1);
    if (over) {
      const under = shown().find((panel) => panel.series.includes(over)).series.at(-2) ?? over;
      const part = `${100 * over.alpha}%`;
      const mixed = `${lineColour(over.colour)} ${part}, ${lineColour(under.colour)}`;
      const line = `height:0;border-top:3px solid color-mix(in srgb, ${mixed})`;
      add("both, one over the other", swatch(line));
    }
    for (const [, meaning] of shown().flatMap((panel) => panel.levels)) {
      add(meaning, swatch("height:0;border-top:2px dotted currentColor"));
    }
    if (shown().some((panel) => panel.mixed.length)) {
      add("both: reliable and unreliable points", swatch(`background:${MIXED}`));
    }
    if (spec.marks.length) {
      add(spec.markMeaning, swatch("height:0;border-top:2px dashed currentColor"));
    }
    if (spec.shades.length) add(spec.shadeMeaning, swatch(`background:${SHADE}`));
    if (shown().some((panel) => panel.stars.length)) add("★ resonance speed");
    legend.replaceChildren(...entries.values());
  }

  // The values at the cursor, beside it.
  function tell() {
    tip.hidden = cursor === null;
    if (cursor === null) {
      said.textContent = "";
      return;
    }
    const x = `${spec.xWords} ${significant(cursor)} ${spec.xUnit}`.trim();
    const rows = element("tbody");
    const words = [x];
    for (const panel of shown()) {
      // Two curves of a panel share a row; the legend says which is which.
      const together = spec.panels.length > 1 && panel.series.length <= 2;
      for (const group of together ? [panel.series] : panel.series.map((series) => [series])) {
        const title = together ? panel.words : group[0].name || panel.words;
        const cells = group.map((series) => {
          const value = significant(series.y[nearest(spec.grids[series.grid], cursor)]);
          const name = together && series.name ? `${title}, ${series.name}` : title;
          words.push(`${name}: ${value} ${panel.unit}`.trim());
          const wide = together && group.length === 1 ? 2 : null;
          return element("td", { "data-name": name, colspan: wide }, lineSign(series), value);
        });
        rows.append(element("tr", {}, element("th", { scope: "row" }, title), ...cells,
          element("td", {}, panel.unit)));
      }
    }
    tip.dataset.x = cursor;
    tip.replaceChildren(element("p", {}, x), element("table", {}, rows));
    said.textContent = words.join("; ");
    placeTip();
  }

  function placeTip() {
    const at = atX(cursor);
    const [right, left] = [at + 12, at - 12 - tip.offsetWidth];
    const room = figure.clientWidth - tip.offsetWidth;
    const fits = right <= room || left < 0;
    tip.style.left = `${Math.max(0, fits ? Math.min(right, room) : left)}px`;
    // Within what is seen of a figure that is higher than the window.
    const bounds = figure.getBoundingClientRect();
    const seen = [Math.max(0, -bounds.top), Math.min(bounds.height, innerHeight - bounds.top)];
    const wanted = (readAt ?? seen[0]) + 14;
    tip.style.top = `${Math.max(seen[0], Math.min(wanted, seen[1] - tip.offsetHeight))}px`;
  }

  function setCursor(x, y = null) {
    [cursor, readAt] = [x, y];
    request();
    tell();
  }

  const mainGrid = () => spec.grids[shown()[0]?.series[0]?.grid ?? 0];
  function read(event) {
    const bounds = canvas.getBoundingClientRect();
    const px = event.clientX - bounds.left;
    if (px < area().left || px > area().left + area().width) return;
    const grid = mainGrid();
    setCursor(grid[nearest(grid, toX(px))], event.clientY - bounds.top);
  }

  let drag = null;
  figure.addEventListener("pointermove", (event) => {
    if (!drag || isWhole()) {
      read(event);
      return;
    }
    const px = event.clientX - canvas.getBoundingClientRect().left;
    const by = ((drag.px - px) / area().width) * (drag.view[1] - drag.view[0]);
    drag.far ||= Math.abs(drag.px - px) > 4;
    if (drag.far) setView(moved(drag.view, by, all));
  });
  figure.addEventListener("pointerdown", (event) => {
    drag = { px: event.clientX - canvas.getBoundingClientRect().left, view, far: false };
    figure.setPointerCapture(event.pointerId);
  });
  figure.addEventListener("pointerup", (event) => {
    if (drag && !drag.far) {
      read(event);
      if (cursor !== null) pick(cursor);
    }
    drag = null;
  });
  figure.addEventListener("pointercancel", () => { drag = null; });
  // A finger that is lifted leaves what it has read.
  figure.addEventListener("pointerleave", (event) => {
    if (event.pointerType === "mouse") setCursor(null);
  });
  figure.addEventListener("blur", () => setCursor(null));
  figure.addEventListener("dblclick", () => setView([...all]));
  zoomByWheel(figure, (event, factor) => {
    zoomBy(factor, even(toX(event.clientX - canvas.getBoundingClientRect().left)));
  });
  figure.addEventListener("keydown", (event) => {
    const grid = mainGrid();
    const [from, to] = visible(grid);
    const stride = (event.shiftKey ? 10 : 1) * Math.max(1, Math.round((to - from) / 200));
    const here = cursor === null ? Math.round((from + to) / 2) : nearest(grid, cursor);
    const step = { ArrowLeft: -stride, ArrowRight: stride }[event.key];
    if (step) setCursor(grid[Math.min(Math.max(here + step, 0), grid.length - 1)]);
    else if (event.key === "+" || event.key === "=") zoomBy(0.7, centre());
    else if (event.key === "-") zoomBy(1 / 0.7, centre());
    else if (event.key === "0") setView([...all]);
    else if (event.key === "Escape") setCursor(null);
    else if (event.key === "Enter" && cursor !== null) pick(cursor);
    else return;
    event.preventDefault();
  });
  darkTheme.addEventListener("change", changed);
  changed();
  return { changed };
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
  const fits = (part) => context.measureText(part).width <= room;
  if (fits(text)) return [text];
  for (let k = text.length; k > 0; k--) {
    if (text[k] === " " && fits(text.slice(0, k))) return [text.slice(0, k), text.slice(k + 1)];
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
  const series = (one) => ({
    ...one, y: floats(one.y), low: one.low && floats(one.low), high: one.high && floats(one.high),
  });
  return {
    ...chart,
    grids: chart.grids.map(floats),
    panels: chart.panels.map((panel) => ({ ...panel, series: panel.series.map(series) })),
  };
}
