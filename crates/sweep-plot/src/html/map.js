// The map over the first two axes: cells, the dividing line, values under the pointer, time
// histories on a click. A cell is one point, or a block of points where the file has more than a
// page carries: then its values are the worst of them, and `counts` says how many are what.

// Margins around the map, px, with the colour bar below.
const MARGINS = { left: 70, right: 14, top: 10, bottom: 130 };

// `panel` computes: it paints finer cells and marks its point.
function createMap(host, data, panel) {
  const [xAxis, yAxis] = data.axes;
  const extra = data.axes.slice(2);
  const [nx, ny] = [xAxis.values.length, yAxis.values.length];
  const cuts = extra.reduce((product, axis) => product * axis.values.length, 1);
  const { columns, codes, word, counts, wordsOf, bit, filled, failed, hasValue, isLost,
    partlyLost, sensitive, verdict } = createCells(data);

  const evenOf = (axis) => (axis.log ? Math.log : (value) => value);
  const [evenX, evenY] = [evenOf(xAxis), evenOf(yAxis)];
  const borders = [xAxis.borders.map(evenX), yAxis.borders.map(evenY)];
  const full = borders.map((list) => [list[0], list[list.length - 1]]);
  let view = full.map((range) => [...range]);
  let rest = [...data.first.rest];
  const listeners = [];
  let hovered = null;
  let pinned = null;
  let cursor = [Math.floor(nx / 2), Math.floor(ny / 2)];

  const centreOf = (place) => place.map((at, k) => 0.5 * (borders[k][at] + borders[k][at + 1]));
  const pointAt = (i, j) => {
    const cut = extra.reduce((index, axis, k) => index * axis.values.length + rest[k], 0);
    return (i * ny + j) * cuts + cut;
  };

  // Controls.
  const quantity = element("select", { id: "quantity", onchange: () => changed() });
  for (const { group, groupWords } of data.layers) {
    if (quantity.querySelector(`[data-group="${group}"]`)) continue;
    quantity.append(element("optgroup", { label: groupWords, "data-group": group },
      ...data.layers.filter((layer) => layer.group === group)
        .map((layer) => element("option", { value: layer.column }, layer.words))));
  }
  quantity.append(element("option", { value: "status" }, "status"));
  quantity.value = data.first.column;
  const controls = element("div", { class: "controls" }, element("label", {}, "Show", quantity));
  extra.forEach((axis, k) => {
    const cut = element("select", { "data-axis": axis.name, onchange: () => {
      rest[k] = Number(cut.value);
      changed();
    } });
    axis.values.forEach((value, index) => {
      const said = `${significant(value)} ${axis.unit}`;
      cut.append(element("option", { value: index, selected: index === rest[k] }, said));
    });
    controls.append(element("label", {}, axis.words, cut));
  });
  const middle = () => view.map(([low, high]) => 0.5 * (low + high));
  const buttons = zoomButtons((factor) => zoom(factor, middle()), () => setView(full));
  buttons.lastChild.id = "reset";
  controls.append(buttons);

  const figure = element("div", {
    class: "figure", id: "map", tabindex: "0", role: "application",
    "aria-label": "Map. Arrow keys move from point to point, Enter keeps a point, "
      + "Escape lets it go, plus and minus zoom, 0 resets.",
  });
  const tip = element("div", { class: "tip", id: "tip", hidden: true });
  const legend = element("ul", { class: "legend", id: "legend" });
  const help = element("p", { class: "help" }, "Hover for values, click or tap to keep a point; "
    + "zoom by the buttons, or by the wheel with Ctrl held; drag to move; double-click to reset. "
    + "Or focus the map and use the arrow keys, Enter, Escape, +, - and 0.");
  const readout = element("aside", {
    class: "readout", id: "readout", "aria-label": "Values at a point",
  });
  const said = element("p", { class: "unseen", id: "said", "aria-live": "polite" });
  const histories = element("section", { id: "histories" });
  host.append(controls, element("div", { class: "columns" },
    element("div", {}, figure, legend, help, said), readout), histories);

  const height = () => Math.min(Math.max(figure.clientWidth, 470), 640);
  const cells = surface(figure, height, paint);
  const over = surface(figure, height, paintOver);
  over.canvas.classList.add("over");
  figure.append(tip);

  const currentLayer = () => data.layers.find((layer) => layer.column === quantity.value) ?? null;

  function changed() {
    const layer = currentLayer();
    figure.dataset.layer = layer ? layer.column : "status";
    document.getElementById("title").textContent = layer ? layer.title : "How each point ended";
    tellLegend(layer);
    cells.request();
    over.request();
    tell();
    listeners.forEach((listener) => listener());
  }

  function setView(next) {
    view = next.map((range) => [...range]);
    // A finger scrolls the page over a whole map, and moves one that is zoomed.
    const isWhole = view.every(([low, high], k) => low <= full[k][0] && high >= full[k][1]);
    figure.style.touchAction = isWhole ? "" : "none";
    cells.request();
    over.request();
  }

  // Geometry: the plot's rectangle, and positions within it.
  function area() {
    const { left, right, top, bottom } = MARGINS;
    return { left, top, width: figure.clientWidth - left - right, height: height() - top - bottom };
  }
  const part = (value, k) => (value - view[k][0]) / (view[k][1] - view[k][0]);
  const at = (share, k) => view[k][0] + share * (view[k][1] - view[k][0]);
  const toPx = (box, x) => box.left + part(x, 0) * box.width;
  const toPy = (box, y) => box.top + box.height * (1 - part(y, 1));
  const fromPx = (box, px) => at((px - box.left) / box.width, 0);
  const fromPy = (box, py) => at(1 - (py - box.top) / box.height, 1);

  // What fills a cell: a colour, "failed", "undefined", or null where the file has no point.
  function filler(layer) {
    const status = codes.status;
    if (!layer) {
      const kinds = kindColours();
      return (cell) => (status.values[cell] === SEVERAL_WORDS
        ? MIXED : kinds[status.values[cell]] ?? null);
    }
    const { values, factor } = columns[layer.column];
    return (cell) => {
      if (hasValue(layer, cell)) {
        if (bit(layer.both, cell)) return MIXED;
        return colourOf(layer, values[cell] * factor);
      }
      if (!filled(cell)) return null;
      return failed(cell) ? "failed" : "undefined";
    };
  }

  function colourOf(layer, value) {
    const colours = palette(layer);
    const place = position(layer.scale, value);
    return colours[Math.min(Math.floor(place * colours.length), colours.length - 1)];
  }

  function kindColours() {
    let next = 1;
    const { kinds } = data.palettes;
    return codes.status.words.map((kind) => (kind === "ok"
      ? themed("faint") : kinds[next++ % kinds.length]));
  }

  function paint(context) {
    const box = area();
    const layer = currentLayer();
    const fill = filler(layer);
    const special = {
      failed: hatching(context, data.palettes.failed), undefined: themed("paper"),
    };
    context.save();
    context.beginPath();
    context.rect(box.left, box.top, box.width, box.height);
    context.clip();
    // Edges on whole pixels: neighbours meet without a seam.
    const xs = borders[0].map((border) => Math.round(toPx(box, border)));
    const ys = borders[1].map((border) => Math.round(toPy(box, border)));
    for (let i = 0; i < nx; i++) {
      if (xs[i + 1] < box.left || xs[i] > box.left + box.width) continue;
      for (let j = 0; j < ny;) {
        const kind = fill(pointAt(i, j));
        const start = j++;
        while (kind !== "undefined" && j < ny && fill(pointAt(i, j)) === kind) j++;
        if (kind === null) continue;
        context.fillStyle = special[kind] ?? kind;
        context.fillRect(xs[i], ys[j], xs[i + 1] - xs[i], ys[start] - ys[j]);
        if (kind === "undefined") {
          const side = Math.min(4, 0.4 * (xs[i + 1] - xs[i]), 0.4 * (ys[start] - ys[j]));
          context.fillStyle = themed("muted");
          const dot = [(xs[i] + xs[i + 1] - side) / 2, (ys[start] + ys[j] - side) / 2];
          context.fillRect(...dot, side, side);
        }
      }
    }
    panel?.cells(context, layer, (x, y) => [toPx(box, x), toPy(box, y)], colourOf);
    if (layer) {
      const least = (list) => Math.min(...list.slice(1).map((at, k) => Math.abs(at - list[k])));
      const side = Math.min(Math.max(Math.round((least(xs) + least(ys)) / 1.5), 3), 8);
      const chaos = { lines: [["#1b1f24", 2.4], ["#ffffff", 1]], falling: true, side };
      const marks = [[partlyLost, hatching(context, null, { side })],
        [sensitive, hatching(context, null, chaos)]];
      for (const [marked, hatch] of marks) {
        context.fillStyle = hatch;
        for (let i = 0; i < nx; i++) {
          for (let j = 0; j < ny; j++) {
            if (!marked(layer, pointAt(i, j))) continue;
            context.fillRect(xs[i], ys[j + 1], xs[i + 1] - xs[i], ys[j] - ys[j + 1]);
          }
        }
      }
    }
    if (layer?.level) {
      const cut = extra.reduce((index, axis, k) => index * axis.values.length + rest[k], 0);
      context.beginPath();
      for (const line of layer.level.lines[cut]) {
        for (let k = 0; k < line.length; k += 2) {
          const at = [toPx(box, evenX(line[k])), toPy(box, evenY(line[k + 1]))];
          if (k === 0) context.moveTo(...at);
          else context.lineTo(...at);
        }
      }
      context.lineJoin = "round";
      for (const [colour, thick] of [["#ffffff", 5], ["#1b1f24", 2.4]]) {
        context.strokeStyle = colour;
        context.lineWidth = thick;
        context.stroke();
      }
    }
    context.restore();
    drawMapAxes(context, box, [xAxis, yAxis], view,
      [(value) => toPx(box, evenX(value)), (value) => toPy(box, evenY(value))]);
    if (layer) drawBar(context, box, layer, MARGINS.right);
    figure.dataset.area = [box.left, box.top, box.width, box.height].join(" ");
    figure.dataset.view = view.flat().join(" ");
  }

  function paintOver(context) {
    const box = area();
    // A figure that has become narrower moves its tip.
    if (hovered) placeTip(hovered);
    context.beginPath();
    context.rect(box.left, box.top, box.width, box.height);
    context.clip();
    // Rings where a click shows time histories, unless it does everywhere.
    if (data.traces && Object.keys(data.traces).length < nx * ny * cuts) {
      for (let i = 0; i < nx; i++) {
        for (let j = 0; j < ny; j++) {
          if (!data.traces[pointAt(i, j)]) continue;
          const [x, y] = centreOf([i, j]);
          for (const [colour, thick] of [["#ffffff", 4], ["#1b1f24", 1.5]]) {
            context.beginPath();
            context.arc(toPx(box, x), toPy(box, y), 4, 0, 2 * Math.PI);
            context.strokeStyle = colour;
            context.lineWidth = thick;
            context.stroke();
          }
        }
      }
    }
    panel?.over(context, (x, y) => [toPx(box, x), toPy(box, y)]);
    for (const [place, thick] of [[hovered, 2], [pinned, 3.5]]) {
      if (!place) continue;
      const [i, j] = place;
      const [left, right] = [toPx(box, borders[0][i]), toPx(box, borders[0][i + 1])];
      const [low, high] = [toPy(box, borders[1][j]), toPy(box, borders[1][j + 1])];
      for (const [colour, extra] of [["#ffffff", 3], ["#1b1f24", 0]]) {
        context.strokeStyle = colour;
        context.lineWidth = thick + extra;
        context.strokeRect(left, high, right - left, low - high);
      }
    }
  }

  function tellLegend(layer) {
    legend.replaceChildren();
    const add = (style, text) => {
      const sign = element("i");
      sign.style.cssText = style;
      legend.append(element("li", {}, sign, text));
    };
    if (layer?.level) {
      const colours = palette(layer);
      // As it is drawn: dark between light, on any ground.
      const line = "height:6px;background:#1b1f24;border:solid #ffffff;border-width:1.5px 0";
      add(line, layer.level.line);
      add(`background:${colours[Math.floor(colours.length * 0.75)]}`, layer.level.above);
      add(`background:${colours[Math.floor(colours.length * 0.25)]}`, layer.level.below);
      const both = layer.both?.some((bits) => bits > 0);
      if (both) add(`background:${MIXED}`, layer.level.both);
    }
    if (!layer) {
      const colours = kindColours();
      codes.status.words.forEach((kind, k) => {
        add(`background:${colours[k]}`, `${kind.replaceAll("_", " ")} (${data.statuses[kind]})`);
      });
      if (codes.status.values.includes(SEVERAL_WORDS)) {
        add(`background:${MIXED}`, "points of several kinds");
      }
    } else if (columns[layer.column].values.some((_, cell) => isLost(layer, cell))) {
      const mixed = counts?.points.some((points, cell) => counts.failed[cell] > 0
        && counts.failed[cell] < points && isLost(layer, cell));
      const lines = `#1b1f24 0 1px,${data.palettes.failed} 1px 6px`;
      add(`background:repeating-linear-gradient(135deg,${lines})`,
        mixed ? "no result: failed or undefined" : "failed: no result");
    }
    if (layer && counts) {
      const lost = [...counts.points.keys()].filter((cell) => partlyLost(layer, cell));
      const kinds = [["failed", lost.some((cell) => counts.failed[cell] > 0)],
        ["undefined", lost.some((cell) => bit(layer.undefined, cell))]];
      if (lost.length > 0) {
        add("background:repeating-linear-gradient(135deg,currentColor 0 1px,transparent 1px 6px)",
          `some points ${kinds.filter(([, there]) => there).map(([kind]) => kind).join(" or ")}`);
      }
    }
    if (layer && columns[layer.column].values.some((_, cell) => sensitive(layer, cell))) {
      const lines = "#1b1f24 0 1px,#ffffff 1px 2px,#1b1f24 2px 3px,transparent 3px 7px";
      add(`background:repeating-linear-gradient(45deg,${lines})`,
        counts ? "some points sensitive: chaotic" : "sensitive: motion is chaotic");
    }
    if (layer && panel?.hasFine()) {
      add("border:1.5px dashed currentColor", "finer cells: preview, not checked");
    }
    if (layer?.group === "ratio" && anyUndefined(layer)) {
      const dot = `radial-gradient(circle,${themed("muted")} 2px,${themed("paper")} 2.5px)`;
      add(`background:${dot};outline:1px solid ${themed("faint")}`, "undefined: no excitation");
    }
  }

  function anyUndefined(layer) {
    return columns[layer.column].values.some((value, cell) => filled(cell) && !failed(cell)
      && !Number.isFinite(value));
  }

  function coordinates([i, j]) {
    const places = [[xAxis, i], [yAxis, j], ...extra.map((axis, k) => [axis, rest[k]])];
    return places.map(([axis, index]) => {
      const [from, to] = axis.spans?.[index] ?? [axis.values[index], axis.values[index]];
      const value = from === to ? significant(from) : `${significant(from)} to ${significant(to)}`;
      return `${axis.words} ${value} ${axis.unit}`.trim();
    });
  }

  // Where no step settles the digits.
  function chaos(cell) {
    const [points, chaotic] = [counts?.points[cell] ?? 1, counts?.sensitive[cell] ?? 0];
    if (points > 1 ? chaotic === 0 : word("sensitive", cell) !== "true") return [];
    const where = points > 1 ? `at ${chaotic} of ${points} points` : "here";
    const said = `The motion is chaotic ${where}: a near twin departs exponentially.`;
    return [element("p", {}, said)];
  }

  // What the readout is of: a point, or a cell and the point in it that has the largest ratio.
  function heading(cell) {
    const point = shownValue("point", cell, 9);
    const points = counts?.points[cell] ?? 1;
    return points > 1 ? `Cell of ${points} points: worst values` : `Point ${point}`;
  }

  function shownValue(name, point, digits = 4) {
    const column = columns[name];
    return column ? significant(column.values[point] * column.factor, digits) : "–";
  }

  function tell() {
    const place = hovered ?? pinned;
    readout.replaceChildren();
    readout.classList.toggle("empty", !place);
    if (!place) {
      readout.append(element("h2", {}, "No point chosen"),
        element("p", {}, "Hover over the map, or focus it and use the arrow keys."));
      tip.hidden = true;
      return;
    }
    const point = pointAt(...place);
    const layer = currentLayer();
    const several = (counts?.points[point] ?? 1) > 1;
    figure.dataset.point = shownValue("point", point, 9);
    readout.append(element("h2", {}, heading(point)));
    for (const line of coordinates(place)) readout.append(element("p", {}, line));
    const largest = word("ratio_max_channel", point);
    const channelWords = largest ? ` (${wordsOf[largest] ?? largest.replaceAll("_", " ")})` : "";
    const where = several ? ` at point ${shownValue("point", point, 9)}` : "";
    readout.append(element("p", { class: "verdict" }, capitalised(verdict(point))),
      ...chaos(point),
      element("p", { id: "ratio" },
        `Largest ratio ${shownValue("ratio_max", point)}${channelWords}${where}`));
    if (!Number.isNaN(columns.fail_time_s?.values[point] ?? NaN)) {
      const failedAt = shownValue("fail_time_s", point);
      readout.append(element("p", {}, `${several ? "First failed" : "Failed"} at ${failedAt} s`));
    }
    const kinds = ["nonlinear", "linear", "ratio"];
    const cell = (column, k) => element("td", { "data-kind": kinds[k] },
      column === null ? "" : shownValue(column, point));
    const rows = data.rows.map((row) => element("tr", { "data-channel": row.name },
      element("th", { scope: "row" }, withUnit(row.words, row.unit)), ...row.columns.map(cell)));
    readout.append(element("table", {}, tableHead(["", ...kinds]),
      element("tbody", {}, ...rows)));
    if (data.traces) {
      readout.append(element("p", { class: "help" }, data.traces[point]
        ? "Click or press Enter for its time histories." : "No time history kept for this point."));
    }
    const value = layer ? `${layer.label}: ${shownValue(layer.column, point)}` : "";
    const lines = [...coordinates(place), ...(value ? [value] : []), verdict(point)];
    said.textContent = lines.join("; ");
    tip.textContent = lines.join("\n");
    tip.hidden = !hovered;
    if (hovered) placeTip(hovered);
  }

  function placeTip([i, j]) {
    const box = area();
    const [right, left] = [toPx(box, borders[0][i + 1]) + 10, toPx(box, borders[0][i]) - 10];
    const top = toPy(box, borders[1][j + 1]);
    const fits = right + tip.offsetWidth < figure.clientWidth;
    tip.style.left = `${fits ? right : Math.max(0, left - tip.offsetWidth)}px`;
    const lowest = box.top + box.height - tip.offsetHeight;
    tip.style.top = `${Math.min(Math.max(top, box.top), lowest)}px`;
  }

  function hover(place) {
    if (hovered?.[0] === place?.[0] && hovered?.[1] === place?.[1]) return;
    hovered = place;
    if (place) cursor = place;
    over.request();
    tell();
  }

  function pin(place) {
    pinned = place;
    over.request();
    showHistories(place);
    if (place) panel?.pinned(valuesAt(place));
    tell();
  }

  // Values of all axes at a place.
  const valuesAt = (place) => data.axes.map((axis, k) => axis.values[k < 2 ? place[k]
    : rest[k - 2]]);

  function cutAt(k, index) {
    rest[k] = index;
    controls.querySelectorAll("select[data-axis]")[k].value = index;
  }

  // What a panel needs of the map: where its axes are among the sliders, and how to redraw.
  function connected() {
    const even = [evenX, evenY, ...extra.map(evenOf)];
    return {
      sliders: data.axes.map(({ name }) => data.live.sliders.findIndex((one) => one.name === name)),
      start: valuesAt(cursor),
      even: (k, value) => even[k](value),
      back: (k, value) => (data.axes[k].log ? Math.exp(value) : value),
      // About a point, so many cells wide; the view, if it is zoomed.
      region: (at, cells) => view.map(([low, high], k) => {
        if (low > full[k][0] || high < full[k][1]) return [low, high];
        const half = (0.5 * cells * (high - low)) / (k === 0 ? nx : ny);
        const middle = even[k](at[k]);
        return [Math.max(middle - half, low), Math.min(middle + half, high)];
      }),
      mark: over.request,
      request: () => {
        tellLegend(currentLayer());
        cells.request();
      },
    };
  }

  function showHistories(place) {
    histories.replaceChildren();
    const point = place && pointAt(...place);
    const trace = place && data.traces?.[point];
    if (!trace) return;
    histories.append(element("h2", {}, `Time histories at ${coordinates(place).join(", ")}`));
    const shown = currentLayer()?.channel ?? word("ratio_max_channel", point);
    createHistories(histories, trace, shown);
  }

  // Pointer and keys.
  const cellAt = (event) => {
    const box = area();
    const bounds = cells.canvas.getBoundingClientRect();
    const [px, py] = [event.clientX - bounds.left, event.clientY - bounds.top];
    const within = (value, from, size) => value >= from && value < from + size;
    if (!within(px, box.left, box.width) || !within(py, box.top, box.height)) return null;
    const find = (list, even) => Math.min(Math.max(lowerBound(list, even) - 1, 0), list.length - 2);
    return [find(borders[0], fromPx(box, px)), find(borders[1], fromPy(box, py))];
  };
  let drag = null;
  figure.addEventListener("pointermove", (event) => {
    if (drag) {
      const box = area();
      const [x, y] = [event.clientX - drag.at[0], event.clientY - drag.at[1]];
      const shift = [-x / box.width, y / box.height];
      const shifted = (range, k) => moved(range, shift[k] * (range[1] - range[0]), full[k]);
      drag.far ||= Math.hypot(x, y) > 4;
      if (drag.far) setView(drag.view.map(shifted));
    }
    hover(drag?.far ? null : cellAt(event));
  });
  figure.addEventListener("pointerdown", (event) => {
    drag = { at: [event.clientX, event.clientY], view, far: false };
    figure.setPointerCapture(event.pointerId);
  });
  figure.addEventListener("pointerup", (event) => {
    const clicked = drag && !drag.far ? cellAt(event) : null;
    drag = null;
    if (clicked) pin(clicked);
  });
  figure.addEventListener("pointercancel", () => { drag = null; });
  // A finger that is lifted leaves what it has read.
  figure.addEventListener("pointerleave", (event) => {
    if (event.pointerType === "mouse") hover(null);
  });
  figure.addEventListener("blur", () => hover(null));
  figure.addEventListener("dblclick", () => setView(full));
  function zoom(factor, centre) {
    setView(view.map((range, k) => zoomed(range, factor, centre[k], full[k])));
  }
  zoomByWheel(figure, (event, factor) => {
    const [box, bounds] = [area(), cells.canvas.getBoundingClientRect()];
    const place = [event.clientX - bounds.left, event.clientY - bounds.top];
    zoom(factor, [fromPx(box, place[0]), fromPy(box, place[1])]);
    hover(cellAt(event));
  });
  figure.addEventListener("keydown", (event) => {
    const arrows = {
      ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1],
    };
    const [step, centre] = [arrows[event.key], centreOf(cursor)];
    if (step) {
      const reach = event.shiftKey ? 5 : 1;
      const next = cursor.map((at, k) => at + reach * step[k]);
      const last = [nx - 1, ny - 1];
      hover(hovered ? next.map((at, k) => Math.min(Math.max(at, 0), last[k])) : [...cursor]);
    } else if (event.key === "Enter" || event.key === " ") pin([...cursor]);
    else if (event.key === "Escape") pin(null);
    else if (event.key === "+" || event.key === "=") zoom(0.7, centre);
    else if (event.key === "-") zoom(1 / 0.7, centre);
    else if (event.key === "0") setView(full);
    else return;
    event.preventDefault();
  });
  darkTheme.addEventListener("change", () => tellLegend(currentLayer()));
  changed();
  panel?.connect(connected());
  return {
    cells: { columns, counts, filled, failed, word, verdict, shownValue },
    layer: currentLayer,
    onChange: (listener) => listeners.push(listener),
    // The parts of the picture, from below.
    canvases: [cells.canvas, over.canvas],
    title: () => document.getElementById("title").textContent,
    // The point that is kept, or the one under the pointer.
    chosen: () => pinned ?? hovered,
    index: pointAt,
    coordinates,
    // What a link holds, and back.
    state: () => ({ show: quantity.value, rest, view: view.flat(), pinned }),
    restore(state) {
      const offers = (select, value) => [...select.options].some((one) => one.value === value);
      if (offers(quantity, state.show)) quantity.value = state.show;
      extra.forEach((axis, k) => {
        if (state.rest?.[k] >= 0 && state.rest[k] < axis.values.length) cutAt(k, state.rest[k]);
      });
      const [x0, x1, y0, y1] = state.view ?? [];
      if (x1 > x0 && y1 > y0) setView([[x0, x1], [y0, y1]]);
      const [i, j] = state.pinned ?? [];
      if (i >= 0 && i < nx && j >= 0 && j < ny) pin([i, j]);
      changed();
    },
    go(cell) {
      const [i, j] = [Math.floor(cell / cuts / ny), Math.floor(cell / cuts) % ny];
      let left = cell % cuts;
      for (let k = extra.length - 1; k >= 0; k--) {
        cutAt(k, left % extra[k].values.length);
        left = Math.floor(left / extra[k].values.length);
      }
      hover(null);
      cursor = [i, j];
      pin(cursor);
      changed();
      figure.focus();
    },
  };
}
