// The map over the first two axes: cells, the dividing line, values under the pointer, and time
// histories on a click. A cell is one point, or a block of points if the file has more points than
// a page can carry; the values of a cell are then the worst values of the block.

// Margins around the map, px, with the colour bar below.
const MARGINS = { left: 70, right: 14, top: 10, bottom: 130 };

// Creates the map in a host element. `panel` is the live panel, which paints finer cells and marks
// the point that it computes.
function createMap(host, data, panel) {
  const [xAxis, yAxis] = data.axes;
  const furtherAxes = data.axes.slice(2);
  const [nx, ny] = [xAxis.values.length, yAxis.values.length];
  const cutCount = furtherAxes.reduce((product, axis) => product * axis.values.length, 1);
  const { columns, codes, word, counts, wordsOf, isBitSet, isFilled, hasFailed, hasValue,
    hasMissingValues, placesOf, isSensitive, valuesOf, verdict } = createCells(data);

  const toCoordinates = data.axes.map((axis) => (axis.log ? Math.log : (value) => value));
  const [toCoordinateX, toCoordinateY] = toCoordinates;
  const borders = [xAxis.borders.map(toCoordinateX), yAxis.borders.map(toCoordinateY)];
  const fullView = borders.map((list) => [list[0], list[list.length - 1]]);
  let view = fullView.map((range) => [...range]);
  let otherPlaces = [...data.first.rest];
  const listeners = [];
  let hovered = null;
  let pinned = null;
  let cursor = [Math.floor(nx / 2), Math.floor(ny / 2)];

  const cellCentre = (place) => place.map((at, k) => 0.5 * (borders[k][at] + borders[k][at + 1]));
  const currentCut = () => furtherAxes
    .reduce((index, axis, k) => index * axis.values.length + otherPlaces[k], 0);
  const pointAt = (i, j) => (i * ny + j) * cutCount + currentCut();
  const places = Array.from({ length: nx * ny }, (_, at) => [Math.floor(at / ny), at % ny]);

  const findElement = appendTemplate(host, "map");
  const [controls, figure, tip, legend, readout, announcement, histories] = [".controls", "#map",
    "#tip", "#legend", "#readout", "#said", "#histories"].map(findElement);
  const quantity = findElement("#quantity");
  quantity.addEventListener("change", () => changed());
  for (const { group, groupWords } of data.layers) {
    if (quantity.querySelector(`[data-group="${group}"]`)) continue;
    quantity.append(element("optgroup", { label: groupWords, "data-group": group },
      ...data.layers.filter((layer) => layer.group === group)
        .map((layer) => element("option", { value: layer.column }, layer.words))));
  }
  quantity.append(element("option", { value: "status" }, "status"));
  quantity.value = data.first.column;
  furtherAxes.forEach((axis, k) => {
    const cut = element("select", { "data-axis": axis.name, onchange: () => {
      otherPlaces[k] = Number(cut.value);
      changed();
    } });
    cut.append(...axis.values.map((value, index) => element("option",
      { value: index, selected: index === otherPlaces[k] },
      `${formatSignificant(value)} ${axis.unit}`)));
    controls.append(element("label", {}, axis.words, cut));
  });

  const height = () => Math.min(Math.max(figure.clientWidth, 470), 640);
  const cellSurface = createSurface(figure, height, paint);
  const overlaySurface = createSurface(figure, height, paintOverlay);
  overlaySurface.canvas.classList.add("over");

  const currentLayer = () => data.layers.find((layer) => layer.column === quantity.value) ?? null;

  function changed() {
    const layer = currentLayer();
    figure.dataset.layer = layer ? layer.column : "status";
    document.getElementById("title").textContent = layer ? layer.title : "How each point ended";
    updateLegend(layer);
    cellSurface.request();
    overlaySurface.request();
    showReadout();
    listeners.forEach((listener) => listener());
  }

  function setView(next) {
    view = next.map((range) => [...range]);
    // A finger scrolls the page over a whole map, and moves one that is zoomed.
    figure.style.touchAction = isZoomed() ? "none" : "";
    cellSurface.request();
    overlaySurface.request();
  }

  const isZoomed = () => view
    .some(([low, high], k) => low > fullView[k][0] || high < fullView[k][1]);

  // Geometry: the plot's rectangle, and positions within it.
  function area() {
    const { left, right, top, bottom } = MARGINS;
    return { left, top, width: figure.clientWidth - left - right, height: height() - top - bottom };
  }
  const viewFraction = (value, k) => (value - view[k][0]) / (view[k][1] - view[k][0]);
  const fromFraction = (fraction, k) => view[k][0] + fraction * (view[k][1] - view[k][0]);
  const toPx = (box, x) => box.left + viewFraction(x, 0) * box.width;
  const toPy = (box, y) => box.top + box.height * (1 - viewFraction(y, 1));
  const fromPx = (box, px) => fromFraction((px - box.left) / box.width, 0);
  const fromPy = (box, py) => fromFraction(1 - (py - box.top) / box.height, 1);

  // Returns the filling of a cell: a colour, "failed", "undefined", or null if the file has no
  // point.
  function createFiller(layer) {
    if (!layer) {
      const { values, words } = codes.status;
      return (cell) => (values[cell] === SEVERAL_WORDS
        ? BOTH_SIDES_COLOUR : data.palettes.kinds[words[values[cell]]] ?? null);
    }
    const { values, factor } = columns[layer.column];
    return (cell) => {
      if (hasValue(layer, cell)) {
        if (isBitSet(layer.both, cell)) return BOTH_SIDES_COLOUR;
        return colourOf(layer, values[cell] * factor);
      }
      if (!isFilled(cell)) return null;
      return hasFailed(cell) ? "failed" : "undefined";
    };
  }

  function colourOf(layer, value) {
    const { colours } = layer;
    const place = Math.floor(position(layer.scale, value) * colours.length);
    return colours[Math.min(place, colours.length - 1)];
  }

  function paint(context) {
    const box = area();
    const layer = currentLayer();
    const fill = createFiller(layer);
    const fillStyles = {
      failed: createHatchPattern(context, data.palettes.failed),
      undefined: themeColour("paper"),
    };
    context.save();
    context.beginPath();
    context.rect(box.left, box.top, box.width, box.height);
    context.clip();
    // Edges lie on whole pixels, so that neighbours meet without a seam.
    const xs = borders[0].map((border) => Math.round(toPx(box, border)));
    const ys = borders[1].map((border) => Math.round(toPy(box, border)));
    for (let i = 0; i < nx; i++) {
      if (xs[i + 1] < box.left || xs[i] > box.left + box.width) continue;
      for (let j = 0; j < ny;) {
        const kind = fill(pointAt(i, j));
        const start = j++;
        while (kind !== "undefined" && j < ny && fill(pointAt(i, j)) === kind) j++;
        if (kind === null) continue;
        context.fillStyle = fillStyles[kind] ?? kind;
        context.fillRect(xs[i], ys[j], xs[i + 1] - xs[i], ys[start] - ys[j]);
        if (kind === "undefined") {
          const side = Math.min(4, 0.4 * (xs[i + 1] - xs[i]), 0.4 * (ys[start] - ys[j]));
          context.fillStyle = themeColour("muted");
          const dot = [(xs[i] + xs[i + 1] - side) / 2, (ys[start] + ys[j] - side) / 2];
          context.fillRect(...dot, side, side);
        }
      }
    }
    panel?.cells(context, layer, (x, y) => [toPx(box, x), toPy(box, y)], colourOf);
    if (layer) {
      const minDistance = (list) => Math.min(
        ...list.slice(1).map((at, k) => Math.abs(at - list[k])),
      );
      const side = Math.min(Math.max(Math.round((minDistance(xs) + minDistance(ys)) / 1.5), 3), 8);
      const chaosHatch = { lines: [[DARK, 2.4], [LIGHT, 1]], falling: true, side };
      const hatches = [[hasMissingValues, createHatchPattern(context, null, { side })],
        [isSensitive, createHatchPattern(context, null, chaosHatch)]];
      for (const [isHatched, hatch] of hatches) {
        context.fillStyle = hatch;
        for (const [i, j] of places) {
          if (!isHatched(layer, pointAt(i, j))) continue;
          context.fillRect(xs[i], ys[j + 1], xs[i + 1] - xs[i], ys[j] - ys[j + 1]);
        }
      }
    }
    if (layer?.lines) {
      context.beginPath();
      for (const line of layer.lines[currentCut()]) {
        for (let k = 0; k < line.length; k += 2) {
          const at = [toPx(box, toCoordinateX(line[k])), toPy(box, toCoordinateY(line[k + 1]))];
          if (k === 0) context.moveTo(...at);
          else context.lineTo(...at);
        }
      }
      context.lineJoin = "round";
      strokeOutlined(context, [5, 2.4]);
    }
    context.restore();
    const range = (axis, k) => view[k].map((even) => (axis.log ? Math.exp(even) : even));
    drawAxes(context, box,
      { ...xAxis, range: range(xAxis, 0), at: (value) => toPx(box, toCoordinateX(value)) },
      { ...yAxis, range: range(yAxis, 1), at: (value) => toPy(box, toCoordinateY(value)) });
    if (layer) drawColourBar(context, box, layer, MARGINS.right);
    figure.dataset.area = [box.left, box.top, box.width, box.height].join(" ");
    figure.dataset.view = view.flat().join(" ");
  }

  function paintOverlay(context) {
    const box = area();
    // The tip of a figure that became narrower is moved.
    if (hovered) placeTipAt(hovered);
    context.beginPath();
    context.rect(box.left, box.top, box.width, box.height);
    context.clip();
    // Rings mark the cells whose click shows time histories, unless all do.
    if (data.traces && Object.keys(data.traces).length < nx * ny * cutCount) {
      for (const place of places.filter((at) => data.traces[pointAt(...at)])) {
        const [x, y] = cellCentre(place);
        context.beginPath();
        context.arc(toPx(box, x), toPy(box, y), 4, 0, 2 * Math.PI);
        strokeOutlined(context, [4, 1.5]);
      }
    }
    panel?.over(context, (x, y) => [toPx(box, x), toPy(box, y)]);
    for (const [place, lineWidth] of [[hovered, 2], [pinned, 3.5]]) {
      if (!place) continue;
      const [i, j] = place;
      const [left, right] = [toPx(box, borders[0][i]), toPx(box, borders[0][i + 1])];
      const [low, high] = [toPy(box, borders[1][j]), toPy(box, borders[1][j + 1])];
      context.beginPath();
      context.rect(left, high, right - left, low - high);
      strokeOutlined(context, [lineWidth + 3, lineWidth]);
    }
  }

  function updateLegend(layer) {
    const fineEntries = layer && panel?.hasFine()
      ? [["border:1.5px dashed currentColor", "finer cells: preview, not checked"]] : [];
    const entries = [...(layer?.legend ?? data.legend), ...fineEntries];
    legend.replaceChildren(...entries.map(legendEntry));
  }

  function coordinates(place) {
    return placesOf(pointAt(...place)).map((index, k) => {
      const axis = data.axes[k];
      const [from, to] = axis.spans?.[index] ?? [axis.values[index], axis.values[index]];
      const [first, last] = [from, to].map((end) => formatSignificant(end));
      const value = from === to ? first : `${first} to ${last}`;
      return `${axis.words} ${value} ${axis.unit}`.trim();
    });
  }

  function shownValue(name, point, digits = 4) {
    const column = columns[name];
    return column ? formatSignificant(column.values[point] * column.factor, digits) : "–";
  }

  function showReadout() {
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
    const isCellOfSeveral = counts.points[point] > 1;
    figure.dataset.point = shownValue("point", point, 9);
    readout.append(element("h2", {}, isCellOfSeveral
      ? `Cell of ${counts.points[point]} points: worst values` : `Point ${figure.dataset.point}`));
    for (const line of coordinates(place)) readout.append(element("p", {}, line));
    const largest = word("ratio_max_channel", point);
    const channelWords = largest ? ` (${wordsOf(largest)})` : "";
    const pointText = isCellOfSeveral ? ` at point ${figure.dataset.point}` : "";
    readout.append(element("p", { class: "verdict" }, capitalise(verdict(point))),
      // The digits are those of the value if no step of the axis decides on them.
      ...(counts.sensitive[point] ? [element("p", {}, `The motion is chaotic ${isCellOfSeveral
        ? `at ${counts.sensitive[point]} of ${counts.points[point]} points` : "here"}: `
        + "a slightly disturbed trajectory departs exponentially.")] : []),
      element("p", { id: "ratio" },
        `Largest ratio ${shownValue("ratio_max", point)}${channelWords}${pointText}`));
    if (!Number.isNaN(columns.fail_time_s?.values[point] ?? NaN)) {
      const failedAt = shownValue("fail_time_s", point);
      const words = isCellOfSeveral ? "First failed" : "Failed";
      readout.append(element("p", {}, `${words} at ${failedAt} s`));
    }
    const kinds = ["nonlinear", "linear", "ratio"];
    const cell = (column, k) => element("td", { "data-kind": kinds[k] },
      column === null ? "" : shownValue(column, point));
    const rows = data.rows.map((row) => {
      const tableRowElement = tableRow(withUnit(row.words, row.unit), row.columns.map(cell));
      tableRowElement.dataset.channel = row.name;
      return tableRowElement;
    });
    readout.append(table(["", ...kinds], rows));
    if (data.traces) {
      readout.append(element("p", { class: "help" }, data.traces[point]
        ? "Click or press Enter for its time histories." : "No time history kept for this point."));
    }
    const layerTexts = layer ? [`${layer.label}: ${shownValue(layer.column, point)}`] : [];
    const lines = [...coordinates(place), ...layerTexts, verdict(point)];
    announcement.textContent = lines.join("; ");
    tip.textContent = lines.join("\n");
    tip.hidden = !hovered;
    if (hovered) placeTipAt(hovered);
  }

  function placeTipAt([i, j]) {
    const box = area();
    placeTip(tip, [toPx(box, borders[0][i]) - 10, toPx(box, borders[0][i + 1]) + 10],
      toPy(box, borders[1][j + 1]), [box.top, box.top + box.height]);
  }

  function hover(place) {
    if (hovered?.[0] === place?.[0] && hovered?.[1] === place?.[1]) return;
    hovered = place;
    if (place) cursor = place;
    overlaySurface.request();
    showReadout();
  }

  function pin(place) {
    pinned = place;
    overlaySurface.request();
    showHistories(place);
    if (place) panel?.pinned(valuesAt(place));
    showReadout();
  }

  const valuesAt = (place) => valuesOf(pointAt(...place));

  function cutAt(k, index) {
    otherPlaces[k] = index;
    controls.querySelectorAll("select[data-axis]")[k].value = index;
  }

  function showHistories(place) {
    histories.replaceChildren();
    const point = place && pointAt(...place);
    const trace = place && data.traces?.[point];
    if (!trace) return;
    histories.append(element("h2", {}, `Time histories at ${coordinates(place).join(", ")}`));
    const chart = decodeChart(trace);
    const channel = currentLayer()?.channel ?? word("ratio_max_channel", point);
    const shownPanel = chart.panels.find(({ name }) => name === channel) ?? chart.panels[0];
    for (const panel of chart.panels) {
      panel.shown = panel === shownPanel || ["gap", "speed"].includes(panel.name);
    }
    createChart(histories, chart, "Time histories");
  }

  // The reactions to pointer and keys.
  const pointerPosition = ({ clientX, clientY }) => {
    const bounds = cellSurface.canvas.getBoundingClientRect();
    return [clientX - bounds.left, clientY - bounds.top];
  };
  const cellAt = (event) => {
    const [box, [px, py]] = [area(), pointerPosition(event)];
    const isWithin = (value, from, size) => value >= from && value < from + size;
    if (!isWithin(px, box.left, box.width) || !isWithin(py, box.top, box.height)) return null;
    const findCell = (list, even) => Math.min(
      Math.max(lowerBound(list, even) - 1, 0), list.length - 2,
    );
    return [findCell(borders[0], fromPx(box, px)), findCell(borders[1], fromPy(box, py))];
  };
  const zoomButtons = interact(figure, {
    view: () => view,
    isZoomed,
    reset: () => setView(fullView),
    move(from, by) {
      const box = area();
      const shift = [-by[0] / box.width, by[1] / box.height];
      setView(from.map((range, k) => moveView(
        range, shift[k] * (range[1] - range[0]), fullView[k],
      )));
    },
    zoom(factor, event) {
      const middle = view.map(([low, high]) => 0.5 * (low + high));
      let centre = hovered ? cellCentre(hovered) : middle;
      if (event) {
        const [box, px] = [area(), pointerPosition(event)];
        centre = [fromPx(box, px[0]), fromPy(box, px[1])];
      }
      setView(view.map((range, k) => zoomView(range, factor, centre[k], fullView[k])));
      if (event) hover(cellAt(event));
    },
    read: (event) => hover(cellAt(event)),
    letGo: () => hover(null),
    pick: (event) => cellAt(event) && pin(cellAt(event)),
    key(event) {
      const step = {
        ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1],
      }[event.key];
      if (step) {
        const stride = event.shiftKey ? 5 : 1;
        const next = cursor.map((at, k) => at + stride * step[k]);
        const clampPlace = (at, k) => Math.min(Math.max(at, 0), [nx, ny][k] - 1);
        hover(hovered ? next.map(clampPlace) : [...cursor]);
      } else if (event.key === "Enter" || event.key === " ") pin([...cursor]);
      else if (event.key === "Escape") pin(null);
      else return false;
      return true;
    },
  });
  zoomButtons.lastChild.id = "reset";
  controls.append(zoomButtons);
  changed();
  // The interface for a live panel: the map's axes among the sliders, and redrawing.
  panel?.connect({
    sliders: data.axes.map(({ name }) => data.live.sliders.findIndex((one) => one.name === name)),
    start: valuesAt(cursor),
    even: (k, value) => toCoordinates[k](value),
    back: (k, value) => (data.axes[k].log ? Math.exp(value) : value),
    // The range about a point that is so many cells wide, or the view if it is zoomed.
    region: (at, cellsWide) => view.map(([low, high], k) => {
      if (isZoomed()) return [low, high];
      const halfWidth = (0.5 * cellsWide * (high - low)) / (k === 0 ? nx : ny);
      const middle = toCoordinates[k](at[k]);
      return [Math.max(middle - halfWidth, low), Math.min(middle + halfWidth, high)];
    }),
    mark: overlaySurface.request,
    request: () => {
      updateLegend(currentLayer());
      cellSurface.request();
    },
  });
  return {
    cells: { columns, isFilled, word, wordsOf, verdict, valuesOf, shownValue },
    layer: currentLayer,
    onChange: (listener) => listeners.push(listener),
    // The canvases of the picture, the lowest first.
    canvases: [cellSurface.canvas, overlaySurface.canvas],
    title: () => document.getElementById("title").textContent,
    // The pinned point, or the one under the pointer.
    chosen: () => pinned ?? hovered,
    index: pointAt,
    // The state that a link holds, and its restoration.
    state: () => ({ show: quantity.value, rest: otherPlaces, view: view.flat(), pinned }),
    restore(state) {
      const hasOption = (select, value) => [...select.options].some((one) => one.value === value);
      if (hasOption(quantity, state.show)) quantity.value = state.show;
      furtherAxes.forEach((axis, k) => {
        if (state.rest?.[k] >= 0 && state.rest[k] < axis.values.length) cutAt(k, state.rest[k]);
      });
      const [x0, x1, y0, y1] = state.view ?? [];
      if (x1 > x0 && y1 > y0) setView([[x0, x1], [y0, y1]]);
      const [i, j] = state.pinned ?? [];
      if (i >= 0 && i < nx && j >= 0 && j < ny) pin([i, j]);
      changed();
    },
    go(cell) {
      const [i, j, ...cutPlaces] = placesOf(cell);
      cutPlaces.forEach((place, k) => cutAt(k, place));
      hover(null);
      cursor = [i, j];
      pin(cursor);
      changed();
      figure.focus();
    },
  };
}
