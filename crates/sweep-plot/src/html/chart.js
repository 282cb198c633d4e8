// Curves over a common x axis, in panels one above the other, with a picker of panels.

const CHART_MARGINS = { left: 84, right: 16, top: 12, gap: 14, bottom: 46 };

// Builders of a line, a panel and a chart for results of the page itself: linear axes, one grid, no
// marks.
function plainLine(name, colour, y, alpha = 1) {
  return { name, colour, alpha, grid: 0, width: 1.3, dashed: false, y };
}

function plainPanel(name, words, unit, shown, series, height = 150) {
  return { name, words, unit, shown, log: false, height, series, levels: [], stars: [], mixed: [] };
}

function plainChart(xWords, xUnit, grid, panels) {
  const xRange = [grid[0], grid.at(-1) || 1];
  return { xWords, xUnit, xLog: false, xRange, grids: [grid], panels, marks: [], shades: [] };
}

// Creates a chart in a host element. `spec` is a chart of the page's data with decoded arrays:
// { xWords, xUnit, xLog, xRange, xTicks, grids, panels, marks, markMeaning, shades, shadeMeaning }.
// `pick` is called with the x of a click, and of the cursor when Enter is pressed.
function createChart(host, spec, name, pick = () => {}) {
  const toCoordinate = (x) => (spec.xLog ? Math.log(x) : x);
  const fromCoordinate = (x) => (spec.xLog ? Math.exp(x) : x);
  const fullView = spec.xRange.map(toCoordinate);
  let view = [...fullView];
  let cursor = null;
  // The height of the pointer, px from the figure's top; null if the cursor was moved by keys.
  let pointerY = null;

  const findElement = appendTemplate(host, "chart");
  const [picker, figure, tip, legend, announcement] = [".controls", ".figure", ".tip", ".legend",
    ".unseen"].map(findElement);
  figure.ariaLabel = `${name}. Arrow keys read values, plus and minus zoom, 0 resets.`;
  if (spec.panels.length > 1) {
    picker.append(element("legend", {}, "Show"), ...spec.panels.map((panel) => {
      const box = element("input", { type: "checkbox", checked: panel.shown, onchange: () => {
        panel.shown = box.checked;
        changed();
      } });
      return element("label", {}, box, capitalise(panel.words));
    }));
  }

  // Labels of marks stand above the panels, not on the curves.
  const markStripHeight = spec.marks.length ? 66 : 0;
  const shownPanels = () => spec.panels.filter((panel) => panel.shown);
  const panelsHeight = () => shownPanels()
    .reduce((sum, panel) => sum + panel.height + CHART_MARGINS.gap, 0);
  const height = () => CHART_MARGINS.top + markStripHeight + panelsHeight() + CHART_MARGINS.bottom;
  const { request, canvas } = createSurface(figure, height, paint);
  const area = () => ({
    left: CHART_MARGINS.left,
    width: figure.clientWidth - CHART_MARGINS.left - CHART_MARGINS.right,
  });
  const viewFraction = (x) => (toCoordinate(x) - view[0]) / (view[1] - view[0]);
  const atX = (x) => area().left + viewFraction(x) * area().width;
  const toX = (px) => fromCoordinate(
    view[0] + ((px - area().left) / area().width) * (view[1] - view[0]),
  );

  function changed() {
    request();
    updateLegend();
    showReadout();
  }

  function setView(next) {
    view = next;
    figure.dataset.view = view.map(fromCoordinate).join(" ");
    changed();
  }

  // Returns the indices of a grid's points in the view, and one beyond on each side.
  function visibleRange(grid) {
    const from = Math.max(lowerBound(grid, fromCoordinate(view[0])) - 1, 0);
    return [from, Math.min(lowerBound(grid, fromCoordinate(view[1])) + 1, grid.length - 1)];
  }

  function yRange(panel) {
    if (panel.range) return panel.range;
    let [low, high] = [Infinity, -Infinity];
    const extendRange = (value) => {
      if (!Number.isFinite(value) || (panel.log && value <= 0)) return;
      [low, high] = [Math.min(low, value), Math.max(high, value)];
    };
    for (const series of panel.series) {
      const [from, to] = visibleRange(spec.grids[series.grid]);
      for (const values of [series.y, series.low, series.high]) {
        values?.subarray(from, to + 1).forEach(extendRange);
      }
    }
    panel.levels.forEach(([value]) => extendRange(value));
    if (!(low <= high)) [low, high] = panel.log ? [1, 10] : [0, 1];
    if (panel.log) return [low / 1.15, high * 1.15];
    const margin = high > low ? 0.05 * (high - low) : 0.05 * Math.max(Math.abs(high), 1);
    return [low - margin, high + margin];
  }

  // Returns whether a panel has a point of a line, a dot or a star.
  function hasValues(panel) {
    const isShown = (y) => Number.isFinite(y) && (!panel.log || y > 0);
    const hasSeriesValues = ({ y, low, high }) => [y, low, high]
      .some((values) => values?.some(isShown));
    return panel.stars.length > 0 || panel.series.some(hasSeriesValues);
  }

  function paint(context) {
    const box = { ...area(), top: CHART_MARGINS.top + markStripHeight };
    drawMarkLabels(context, box);
    context.lineJoin = "round";
    const panels = shownPanels();
    for (const panel of panels) {
      box.height = panel.height;
      const [low, high] = yRange(panel);
      const scale = (y) => (panel.log ? Math.log(y) : y);
      const heightFraction = (y) => (scale(y) - scale(low)) / (scale(high) - scale(low));
      const { top } = box;
      const atY = (y) => top + panel.height * (1 - heightFraction(y));
      const [right, bottom] = [box.left + box.width, top + panel.height];
      const axisTitle = panel === panels.at(-1) && { words: spec.xWords, unit: spec.xUnit };
      const range = view.map(fromCoordinate);
      drawAxes(context, box, { range, at: atX, ticks: spec.xTicks, ...axisTitle },
        { ...panel, range: [low, high], at: atY }, true);
      context.save();
      context.beginPath();
      context.rect(box.left, top, box.width, panel.height);
      context.clip();
      const shades = [[spec.shades, UNSTABLE_COLOUR], [panel.mixed, BOTH_SIDES_COLOUR]];
      for (const [ranges, colour] of shades) {
        context.fillStyle = colour;
        for (const [from, to] of ranges) {
          context.fillRect(atX(from), top, Math.max(atX(to) - atX(from), 1), panel.height);
        }
      }
      const dots = panel.series.map((series) => drawSeries(context, series, atY, box));
      for (const [value] of panel.levels) {
        drawLine(context, box.left, atY(value), right, atY(value), [3, 3], themeColour("ink"));
      }
      if (!hasValues(panel)) {
        write(context, "no values to show", box.left + box.width / 2, top + panel.height / 2);
      }
      for (const [x] of spec.marks) {
        drawLine(context, atX(x), top, atX(x), bottom, [6, 4], themeColour("muted"));
      }
      for (const [x, y, label] of panel.stars) {
        write(context, "★", atX(x), atY(y) + 6, { size: 20 });
        write(context, label, atX(x) - 12, atY(y) - 5, { align: "right" });
      }
      context.restore();
      // Dots are drawn after the clip, so that they are whole at the frame.
      dots.forEach((path, k) => {
        context.fillStyle = lineColour(panel.series[k].colour);
        context.fill(path);
      });
      if (cursor !== null) {
        drawLine(context, atX(cursor), top, atX(cursor), bottom, [], themeColour("accent"));
      }
      box.top += panel.height + CHART_MARGINS.gap;
    }
  }

  // Draws the labels of marks. A label that would cover the label before it is moved to the right.
  function drawMarkLabels(context, { left, top, width }) {
    let nextFreeX = -Infinity;
    for (const [x, label] of spec.marks) {
      const markX = atX(x);
      if (markX < left || markX > left + width) continue;
      const labelX = Math.max(markX, nextFreeX);
      nextFreeX = labelX + 15;
      drawLine(context, markX, top, labelX, top - 8, [], themeColour("muted"));
      write(context, label, labelX + 4, top - 11, { align: "left", size: 12, isVertical: true });
    }
  }

  // Returns the dots within the box: those of a series of dots, and isolated points of lines.
  function drawSeries(context, series, atY, box) {
    const dots = new Path2D();
    const grid = spec.grids[series.grid];
    const [from, to] = visibleRange(grid);
    context.strokeStyle = context.fillStyle = lineColour(series.colour);
    if (series.low) {
      context.beginPath();
      for (let k = from; k <= to; k++) context.lineTo(atX(grid[k]), atY(series.high[k]));
      for (let k = to; k >= from; k--) context.lineTo(atX(grid[k]), atY(series.low[k]));
      context.globalAlpha = 0.35;
      context.fill();
    }
    context.globalAlpha = series.alpha;
    context.lineWidth = series.width;
    context.setLineDash(series.dashed ? [8, 5] : []);
    // The first, the least, the greatest and the last point of a pixel column make the same picture
    // as all points in it.
    const isCrowded = to - from > 4 * box.width;
    const runs = [[]];
    for (let k = from; k <= to; k++) {
      const [run, x, y] = [runs.at(-1), atX(grid[k]), atY(series.y[k])];
      if (!Number.isFinite(series.y[k])) {
        if (run.length) runs.push([]);
        continue;
      }
      const last = isCrowded ? run.at(-1) : null;
      if (last && Math.floor(last[0]) === Math.floor(x)) {
        last[1].splice(1, 3, Math.min(...last[1], y), Math.max(...last[1], y), y);
      } else run.push([x, [y]]);
    }
    for (const run of runs) {
      if (!series.dots) {
        context.beginPath();
        for (const [x, ys] of run) ys.forEach((y) => context.lineTo(x, y));
        context.stroke();
        if (run.length > 1) continue;
      }
      for (const [x, ys] of run) ys.forEach((y) => {
        const boxFractions = [(x - box.left) / box.width, (y - box.top) / box.height];
        if (!boxFractions.every((at) => at >= 0 && at <= 1)) return;
        dots.moveTo(x, y);
        dots.arc(x, y, series.dots ? series.width / 2 : 3, 0, 2 * Math.PI);
      });
    }
    context.setLineDash([]);
    context.globalAlpha = 1;
    return dots;
  }

  const symbolStyle = (series) => (series.dots
    ? `width:9px;height:9px;border-radius:5px;margin:0 9px;background:${lineColour(series.colour)}`
    : `height:0;border-top:3px ${series.dashed ? "dashed" : "solid"} ${lineColour(series.colour)}`);

  // Updates the legend of lines and marks.
  function updateLegend() {
    const entries = new Map();
    const addEntry = (words, style = null) => {
      if (!entries.has(words)) entries.set(words, legendEntry([style, words]));
    };
    for (const panel of shownPanels()) {
      for (const series of panel.series) addEntry(series.name || panel.words, symbolStyle(series));
    }
    const overlappingPair = shownPanels().map((panel) => panel.series.slice(-2))
      .find((series) => series.at(-1)?.alpha < 1);
    if (overlappingPair) {
      const [under, over] = [overlappingPair[0], overlappingPair.at(-1)]
        .map((series) => lineColour(series.colour));
      const mixedColours = `${over} ${100 * overlappingPair.at(-1).alpha}%, ${under}`;
      const lineStyle = `height:0;border-top:3px solid color-mix(in srgb, ${mixedColours})`;
      addEntry("both, one over the other", lineStyle);
    }
    for (const [, meaning] of shownPanels().flatMap((panel) => panel.levels)) {
      addEntry(meaning, "height:0;border-top:2px dotted currentColor");
    }
    if (shownPanels().some((panel) => panel.mixed.length)) {
      addEntry("both: reliable and unreliable points", `background:${BOTH_SIDES_COLOUR}`);
    }
    if (spec.marks.length) {
      addEntry(spec.markMeaning, "height:0;border-top:2px dashed currentColor");
    }
    if (spec.shades.length) addEntry(spec.shadeMeaning, `background:${UNSTABLE_COLOUR}`);
    if (shownPanels().some((panel) => panel.stars.length)) addEntry("★ resonance speed");
    legend.replaceChildren(...entries.values());
  }

  // Shows the values at the cursor beside it.
  function showReadout() {
    tip.hidden = cursor === null;
    if (cursor === null) {
      announcement.textContent = "";
      return;
    }
    const xText = `${spec.xWords} ${formatSignificant(cursor)} ${spec.xUnit}`.trim();
    const rows = [];
    const readoutTexts = [xText];
    for (const panel of shownPanels()) {
      // Two curves of a panel share a row, in which the legend's symbols identify them.
      const sharesRow = spec.panels.length > 1 && panel.series.length <= 2;
      for (const group of sharesRow ? [panel.series] : panel.series.map((series) => [series])) {
        const title = sharesRow ? panel.words : group[0].name || panel.words;
        const cells = group.map((series) => {
          const value = formatSignificant(series.y[nearest(spec.grids[series.grid], cursor)]);
          const name = sharesRow && series.name ? `${title}, ${series.name}` : title;
          readoutTexts.push(`${name}: ${value} ${panel.unit}`.trim());
          const columnSpan = sharesRow && group.length === 1 ? 2 : null;
          const attributes = { "data-name": name, colspan: columnSpan };
          return element("td", attributes, swatch(symbolStyle(series)), value);
        });
        rows.push(tableRow(title, [...cells, panel.unit]));
      }
    }
    tip.dataset.x = cursor;
    tip.replaceChildren(element("p", {}, xText), table([], rows));
    announcement.textContent = readoutTexts.join("; ");
    // The box stays within the visible part of a figure that is higher than the window.
    const bounds = figure.getBoundingClientRect();
    const visibleHeights = [
      Math.max(0, -bounds.top), Math.min(bounds.height, innerHeight - bounds.top),
    ];
    placeTip(tip, [atX(cursor) - 12, atX(cursor) + 12], (pointerY ?? visibleHeights[0]) + 14,
      visibleHeights);
  }

  function setCursor(x, y = null) {
    [cursor, pointerY] = [x, y];
    request();
    showReadout();
  }

  const mainGrid = () => spec.grids[shownPanels()[0]?.series[0]?.grid ?? 0];
  const pointerX = (event) => event.clientX - canvas.getBoundingClientRect().left;
  function moveCursor(event) {
    const px = pointerX(event);
    if (px < area().left || px > area().left + area().width) return;
    const grid = mainGrid();
    setCursor(grid[nearest(grid, toX(px))], event.clientY - canvas.getBoundingClientRect().top);
  }

  const centre = () => (cursor === null ? (view[0] + view[1]) / 2 : toCoordinate(cursor));
  picker.append(interact(figure, {
    view: () => view,
    isZoomed: () => view[0] > fullView[0] || view[1] < fullView[1],
    reset: () => setView([...fullView]),
    move: (from, [by]) => setView(
      moveView(from, (-by / area().width) * (from[1] - from[0]), fullView),
    ),
    zoom: (factor, event) => setView(zoomView(view, factor,
      event ? toCoordinate(toX(pointerX(event))) : centre(), fullView)),
    read: moveCursor,
    letGo: () => setCursor(null),
    pick(event) {
      moveCursor(event);
      if (cursor !== null) pick(cursor);
    },
    key(event) {
      const grid = mainGrid();
      const [from, to] = visibleRange(grid);
      const stride = (event.shiftKey ? 10 : 1) * Math.max(1, Math.round((to - from) / 200));
      const current = cursor === null ? Math.round((from + to) / 2) : nearest(grid, cursor);
      const step = { ArrowLeft: -stride, ArrowRight: stride }[event.key];
      if (step) setCursor(grid[Math.min(Math.max(current + step, 0), grid.length - 1)]);
      else if (event.key === "Enter" && cursor !== null) pick(cursor);
      else return false;
      return true;
    },
  }));
  darkTheme.addEventListener("change", changed);
  changed();
  return { changed };
}

function nearest(sorted, value) {
  const after = Math.min(lowerBound(sorted, value), sorted.length - 1);
  const before = Math.max(after - 1, 0);
  return value - sorted[before] < sorted[after] - value ? before : after;
}

// Returns the page's chart with decoded arrays; curves of time histories are quantised.
function decodeChart(chart) {
  const decodeCurve = (values) => (typeof values === "string"
    ? decodeFloats(values) : decodeQuantised(values));
  const decodeIfGiven = (values) => values && decodeCurve(values);
  const decodeSeries = (series) => ({
    ...series,
    y: decodeIfGiven(series.y),
    low: decodeIfGiven(series.low),
    high: decodeIfGiven(series.high),
  });
  return {
    ...chart,
    grids: chart.grids.map(decodeIfGiven),
    panels: chart.panels.map((panel) => ({ ...panel, series: panel.series.map(decodeSeries) })),
  };
}
