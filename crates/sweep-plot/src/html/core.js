"use strict";
// Functions that the map and the charts share: they decode data, format numbers, draw axes, create
// canvases that are redrawn when size or theme change, and handle pointer and keys.

function decode(text) {
  const raw = atob(text);
  const bytes = new Uint8Array(raw.length);
  for (let k = 0; k < raw.length; k++) bytes[k] = raw.charCodeAt(k);
  return bytes;
}

// Unpacks gzip and returns a promise of the bytes.
function unpackGzip(text) {
  const stream = new Blob([decode(text)]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).arrayBuffer();
}

const decodeFloats = (text) => new Float32Array(decode(text).buffer);
const decodeDoubles = (text) => new Float64Array(decode(text).buffer);

// Decodes 16-bit integers times their unit; the least integer means no value.
function decodeQuantised([text, unit]) {
  const integers = new Int16Array(decode(text).buffer);
  return Float32Array.from(integers, (value) => (value === -32768 ? NaN : value * unit));
}

function formatSignificant(value, digits = 4) {
  if (value === undefined || value === null || Number.isNaN(value)) return "–";
  if (value === 0) return "0";
  const magnitude = Math.abs(value);
  if (magnitude >= 1e7 || magnitude < 1e-4) return value.toExponential(digits - 1);
  return String(Number(value.toPrecision(digits)));
}

// The page's data. `ticks` has the steps between ticks from which the program's own figures choose.
const DATA = JSON.parse(document.getElementById("data").textContent);

// Returns about `count` ticks from low to high as [value, label]; `sets` are those of a logarithmic
// axis, from sparse to dense.
function ticks(low, high, count, sets) {
  if (!(high > low)) return [];
  const isWithin = ([value]) => value >= low * (1 - 1e-9) && value <= high * (1 + 1e-9);
  let chosenTicks = [];
  for (const set of sets ?? []) {
    const visibleTicks = set.filter(isWithin);
    if (chosenTicks.length >= 2 && visibleTicks.length > Math.max(count, 2) + 1) break;
    chosenTicks = visibleTicks;
  }
  if (chosenTicks.length >= 2) return chosenTicks;
  const { steps, slack, least } = DATA.ticks;
  const wantedStep = (slack * (high - low)) / Math.max(count, 1);
  for (let index = steps.findIndex(([step]) => step >= wantedStep); index >= 0; index--) {
    const [step, decimals] = steps[index];
    const [first, last] = [Math.ceil(low / step - 1e-9), Math.floor(high / step + 1e-9)];
    if (last - first + 1 < least) continue;
    return Array.from({ length: last - first + 1 }, (_, k) => {
      const value = (first + k) * step || 0;
      const power = decimals === null && value !== 0 && value.toExponential().replace("e+", "e");
      return [value, power || value.toFixed(decimals ?? 0)];
    });
  }
  return [];
}

// Returns words with their unit, if they have one.
const withUnit = (words, unit) => (unit ? `${words} (${unit})` : words);

const capitalise = (text) => text.charAt(0).toUpperCase() + text.slice(1);

function element(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else if (value === true) node.setAttribute(name, "");
    else if (value !== false && value !== null) node.setAttribute(name, value);
  }
  node.append(...children);
  return node;
}

// Copies a template's elements into a host, and returns a function that finds elements in the host.
function appendTemplate(host, name) {
  host.append(document.getElementById(`${name}-parts`).content.cloneNode(true));
  return (selector) => host.querySelector(selector);
}

// Returns a table's row: its heading, and cells or their texts.
function tableRow(title, cells) {
  return element("tr", {}, element("th", { scope: "row" }, title),
    ...cells.map((cell) => (cell instanceof Element ? cell : element("td", {}, cell))));
}

// Returns a table under heads, if there are any, with a column for each text.
function table(heads, rows, attributes = {}) {
  const cells = heads.map((text) => element("th", { scope: "col" }, text));
  const head = heads.length ? [element("thead", {}, element("tr", {}, ...cells))] : [];
  return element("table", attributes, ...head, element("tbody", {}, ...rows));
}

// Returns a symbol of a legend.
const swatch = (style) => element("i", { style });

// Returns a legend's entry: a symbol, if it has a style, and words.
const legendEntry = ([style, words]) => element("li", {}, ...(style ? [swatch(style)] : []), words);

// Places a tip beside the range from left to right (px) within a figure; its top at y, within the
// bounds.
function placeTip(tip, [left, right], y, [top, bottom]) {
  const maxLeft = tip.parentElement.clientWidth - tip.offsetWidth;
  const fits = right <= maxLeft || left < tip.offsetWidth;
  tip.style.left = `${Math.max(0, fits ? Math.min(right, maxLeft) : left - tip.offsetWidth)}px`;
  tip.style.top = `${Math.max(top, Math.min(y, bottom - tip.offsetHeight))}px`;
}

function themeColour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

const darkTheme = matchMedia("(prefers-color-scheme: dark)");

// Returns a lighter shade of a colour for lines on a dark background.
function lineColour(colour) {
  if (colour === "ink") return themeColour("ink");
  return darkTheme.matches ? `color-mix(in srgb, ${colour} 65%, white)` : colour;
}

const FONT = '"Noto Sans", "Segoe UI", "Helvetica Neue", Arial, sans-serif';
// Colours that are visible on every background: dark on light.
const [DARK, LIGHT] = ["#1b1f24", "#ffffff"];

// Creates a canvas as wide as its host and `height` px high; `draw(context, width, height)` is
// called whenever either changes.
function createSurface(host, height, draw) {
  const canvas = element("canvas", { "aria-hidden": "true" });
  host.append(canvas);
  let pending = 0;
  const paint = () => {
    pending = 0;
    const [width, canvasHeight, ratio] = [host.clientWidth, height(), window.devicePixelRatio || 1];
    if (width === 0) return;
    const size = [Math.round(width * ratio), Math.round(canvasHeight * ratio)];
    if (canvas.width !== size[0] || canvas.height !== size[1]) {
      [canvas.width, canvas.height] = size;
      canvas.style.height = `${canvasHeight}px`;
    }
    const context = canvas.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, canvasHeight);
    draw(context, width, canvasHeight);
  };
  // Several changes before the next frame cause one drawing.
  const request = () => { pending ||= requestAnimationFrame(paint); };
  new ResizeObserver(request).observe(host);
  darkTheme.addEventListener("change", request);
  request();
  return { canvas, request };
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

// Strokes the current path twice with these widths, dark over light.
function strokeOutlined(context, [light, dark], dash = []) {
  for (const [colour, width, dashed] of [[LIGHT, light, []], [DARK, dark, dash]]) {
    context.strokeStyle = colour;
    context.lineWidth = width;
    context.setLineDash(dashed);
    context.stroke();
  }
  context.setLineDash([]);
}

// Writes text in ink, at most `room` px wide; upwards if it `isVertical`.
function write(context, text, x, y, options = {}) {
  const { align = "center", size = 13, room, isVertical = false, bold = "" } = options;
  context.save();
  context.translate(x, y);
  if (isVertical) context.rotate(-Math.PI / 2);
  context.font = `${bold} ${size}px ${FONT}`;
  context.textAlign = align;
  context.fillStyle = themeColour("ink");
  context.fillText(text, 0, 0, room);
  context.restore();
}

// Draws frame, ticks and numbers of a box, and the words of its axes. An axis is { range, at,
// words, unit, ticks }, where `at` maps a value to the screen; an x axis without words has no
// numbers. Ticks are lines through the box if it is `ruled`.
function drawAxes(context, { left, top, width, height }, x, y, ruled) {
  const [bottom, middle] = [top + height, left + width / 2];
  const [ink, ruling] = [themeColour("ink"), themeColour("faint")];
  for (const [value, label] of ticks(...x.range, width / 90, x.ticks)) {
    const at = x.at(value);
    if (ruled) drawLine(context, at, top, at, bottom, [], ruling);
    else drawLine(context, at, bottom, at, bottom + 5, [], ink);
    if (x.words) write(context, label, at, bottom + 18);
  }
  for (const [value, label] of ticks(...y.range, Math.max(3, height / 45), y.ticks)) {
    const at = y.at(value);
    if (ruled) drawLine(context, left, at, left + width, at, [], ruling);
    else drawLine(context, left - 5, at, left, at, [], ink);
    write(context, label, left - 8, at + 4.5, { align: "right" });
  }
  context.strokeStyle = ink;
  context.lineWidth = 1;
  context.strokeRect(left, top, width, height);
  const size = 15;
  if (x.words) write(context, withUnit(x.words, x.unit), middle, bottom + 40, { size });
  write(context, withUnit(y.words, y.unit), 17, top + height / 2, {
    size: height < 300 ? 13 : size, room: height, isVertical: true,
  });
}

// The colour of cells or ranges with points on both sides of a limit.
const BOTH_SIDES_COLOUR = DATA.both;
const UNSTABLE_COLOUR = DATA.shade;

// Connects pointer, keys and buttons (for readers without a wheel) to a figure. `actions` has
// view(), isZoomed() and reset(); move(view, [x, y]) from an earlier view by px; zoom(factor,
// event), by which the view grows about the event's place or, without one, about the reading;
// read(event) and letGo(); pick(event), a click; key(event), which returns whether it uses the key.
function interact(figure, actions) {
  const on = (kind, handler) => figure.addEventListener(kind, handler);
  let drag = null;
  on("pointermove", (event) => {
    const shift = drag ? [event.clientX - drag.at[0], event.clientY - drag.at[1]] : [0, 0];
    if (drag) drag.far ||= Math.hypot(...shift) > 4;
    if (!drag?.far || !actions.isZoomed()) actions.read(event);
    else {
      actions.letGo();
      actions.move(drag.view, shift);
    }
  });
  on("pointerdown", (event) => {
    drag = { at: [event.clientX, event.clientY], view: actions.view(), far: false };
    figure.setPointerCapture(event.pointerId);
  });
  on("pointerup", (event) => {
    const isClick = drag && !drag.far;
    drag = null;
    if (isClick) actions.pick(event);
  });
  on("pointercancel", () => { drag = null; });
  // After a touch the values stay visible, because a finger cannot hover.
  on("pointerleave", (event) => { if (event.pointerType === "mouse") actions.letGo(); });
  on("blur", actions.letGo);
  on("dblclick", actions.reset);
  // The wheel alone scrolls the page. With Ctrl or Command it zooms, and so does a pinch on a
  // trackpad, which browsers report as such a wheel.
  figure.addEventListener("wheel", (event) => {
    if (!event.ctrlKey && !event.metaKey) return;
    event.preventDefault();
    actions.zoom(Math.exp(0.0015 * Math.min(Math.max(event.deltaY, -900), 900)), event);
  }, { passive: false });
  const zoomIn = () => actions.zoom(0.7);
  const zoomOut = () => actions.zoom(1 / 0.7);
  const keys = { "+": zoomIn, "=": zoomIn, "-": zoomOut, 0: actions.reset, Escape: actions.letGo };
  on("keydown", (event) => {
    if (actions.key(event)) event.preventDefault();
    else if (event.key in keys) {
      keys[event.key]();
      event.preventDefault();
    }
  });
  const button = (text, label, onclick) => element("button", {
    type: "button", "aria-label": label, title: label, onclick,
  }, text);
  return element("span", { class: "zoom" }, button("+", "Zoom in", zoomIn),
    button("−", "Zoom out", zoomOut), button("Reset zoom", null, actions.reset));
}

// Returns a view [low, high] zoomed by `factor` about `centre`, within [least, greatest].
function zoomView([low, high], factor, centre, [least, greatest]) {
  const span = Math.min((high - low) * factor, greatest - least);
  const start = centre - ((centre - low) / (high - low)) * span;
  return moveView([start, start + span], 0, [least, greatest]);
}

function moveView([low, high], by, [least, greatest]) {
  const shift = Math.min(Math.max(by, least - low), greatest - high);
  return [low + shift, high + shift];
}

// Returns the index of the first value of a sorted list that is not less than `value`.
function lowerBound(sorted, value) {
  const index = sorted.findIndex((other) => other >= value);
  return index < 0 ? sorted.length : index;
}
