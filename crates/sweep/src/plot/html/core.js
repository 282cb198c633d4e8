"use strict";
// What the map and the charts share: decoding, numbers, ticks, canvases that follow size and theme.

function decode(text) {
  const raw = atob(text);
  const bytes = new Uint8Array(raw.length);
  for (let k = 0; k < raw.length; k++) bytes[k] = raw.charCodeAt(k);
  return bytes;
}

function floats(text) {
  const view = new DataView(decode(text).buffer);
  return Float32Array.from({ length: view.byteLength / 4 }, (_, k) => view.getFloat32(4 * k, true));
}

// Integers of 16 bits times their unit; the least integer stands for no value.
function quantised(text, unit) {
  const view = new DataView(decode(text).buffer);
  return Float32Array.from({ length: view.byteLength / 2 }, (_, k) => {
    const value = view.getInt16(2 * k, true);
    return value === -32768 ? NaN : value * unit;
  });
}

function significant(value, digits = 4) {
  if (value === undefined || value === null || Number.isNaN(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e7 || size < 1e-4) return value.toExponential(digits - 1);
  return String(Number(value.toPrecision(digits)));
}

// Round values from low to high, about count of them, as [value, label].
function ticks(low, high, count, log) {
  if (!(high > low)) return [];
  if (log && high / low >= 3) {
    const sets = [[1], [1, 3], [1, 2, 5], [1, 1.5, 2, 3, 5, 7]];
    const within = (factors) => {
      const found = [];
      for (let power = Math.floor(Math.log10(low)); power <= Math.ceil(Math.log10(high)); power++) {
        for (const factor of factors) {
          const value = factor * 10 ** power;
          if (value >= low * (1 - 1e-9) && value <= high * (1 + 1e-9)) found.push(value);
        }
      }
      return found;
    };
    let best = within(sets[0]);
    for (const factors of sets.slice(1)) {
      const found = within(factors);
      if (best.length >= 2 && found.length > count + 1) break;
      best = found;
    }
    return best.map((value) => [value, significant(value, 2)]);
  }
  const rough = (high - low) / Math.max(count, 1);
  let power = Math.floor(Math.log10(rough));
  let mantissa = [1, 2, 5, 10].find((step) => step >= (0.999 * rough) / 10 ** power) ?? 10;
  const bounds = () => {
    const step = mantissa * 10 ** power;
    return [Math.ceil(low / step - 1e-9), Math.floor(high / step + 1e-9), step];
  };
  let [first, last, step] = bounds();
  // A round step can leave fewer than three ticks, which do not make a scale: the next finer ones then.
  while (last - first < 2) {
    [mantissa, power] = { 10: [5, power], 5: [2, power], 2: [1, power], 1: [5, power - 1] }[mantissa];
    [first, last, step] = bounds();
  }
  const decimals = Math.min(Math.max(-power - (mantissa === 10 ? 1 : 0), 0), 12);
  const found = [];
  for (let k = first; k <= last; k++) found.push([k * step, (k === 0 ? 0 : k * step).toFixed(decimals)]);
  return found;
}

function capitalised(text) {
  return text.charAt(0).toUpperCase() + text.slice(1);
}

function element(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else if (value !== false && value !== null) node.setAttribute(name, value === true ? "" : value);
  }
  node.append(...children);
  return node;
}

function themed(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

const darkTheme = matchMedia("(prefers-color-scheme: dark)");

// The same hues, lighter, for lines on a dark ground.
const onDark = {
  "#0072b2": "#4fa9e2",
  "#d55e00": "#f5893d",
  "#009e73": "#2cc79a",
  "#cc79a7": "#e3a0c6",
};

function lineColour(colour) {
  if (colour === "ink") return themed("ink");
  return darkTheme.matches ? onDark[colour] || colour : colour;
}

const FONT = '"Noto Sans", "Segoe UI", "Helvetica Neue", Arial, sans-serif';

// A canvas as wide as its host and `height` px high; `draw(context, width, height)` whenever either changes.
function surface(host, height, draw) {
  const canvas = element("canvas", { "aria-hidden": "true" });
  host.append(canvas);
  let pending = 0;
  const paint = () => {
    pending = 0;
    const [width, tall, ratio] = [host.clientWidth, height(), window.devicePixelRatio || 1];
    if (width === 0) return;
    const size = [Math.round(width * ratio), Math.round(tall * ratio)];
    if (canvas.width !== size[0] || canvas.height !== size[1]) {
      [canvas.width, canvas.height] = size;
      canvas.style.height = `${tall}px`;
    }
    const context = canvas.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, tall);
    draw(context, width, tall);
  };
  // Many changes before the next frame are one drawing.
  const request = () => {
    if (!pending) pending = requestAnimationFrame(paint);
  };
  new ResizeObserver(request).observe(host);
  darkTheme.addEventListener("change", request);
  request();
  return { canvas, request };
}

// A view [low, high] zoomed by `factor` about `centre`, kept within [least, greatest].
function zoomed([low, high], factor, centre, [least, greatest]) {
  const span = Math.min((high - low) * factor, greatest - least);
  const start = centre - ((centre - low) / (high - low)) * span;
  return moved([start, start + span], 0, [least, greatest]);
}

function moved([low, high], by, [least, greatest]) {
  const shift = Math.min(Math.max(by, least - low), greatest - high);
  return [low + shift, high + shift];
}

function showProvenance(entries) {
  const list = element("dl");
  for (const [key, value] of entries) {
    const body = typeof value === "object" && value !== null
      ? element("details", { open: JSON.stringify(value).length < 600 }, element("summary", {}, "show"),
        element("pre", { tabindex: "0" }, JSON.stringify(value, null, 2)))
      : document.createTextNode(String(value));
    list.append(element("dt", {}, key), element("dd", {}, body));
  }
  const host = document.getElementById("provenance");
  host.append(entries.length ? list : "The file says nothing about its origin.");
}
