// Colour scales and their bars, and hatches.

// Place of a value on a colour scale, from 0 to 1.
function position(scale, value) {
  const even = scale.log ? Math.log : (x) => x;
  let place;
  if (scale.centre === undefined) {
    place = (even(value) - even(scale.low)) / (even(scale.high) - even(scale.low));
  } else {
    const offset = even(value) - even(scale.centre);
    const end = even(offset < 0 ? scale.low : scale.high);
    const half = Math.abs(end - even(scale.centre));
    place = 0.5 + (0.5 * offset) / half;
  }
  return Math.min(Math.max(place, 0), 1);
}

// The colours of a layer, from the low end of its scale to the high one.
function palette(layer) {
  if (layer.scale.centre === undefined) return DATA.palettes.sequential;
  const { diverging } = DATA.palettes;
  return layer.scale.reversed ? [...diverging].reverse() : diverging;
}

// The colour bar below a map, `margin` px from the figure's edge.
function drawBar(context, box, layer, margin) {
  const [y, thick, right] = [box.top + box.height + 72, 16, box.left + box.width];
  const colours = palette(layer);
  colours.forEach((colour, k) => {
    const border = (step) => Math.round(box.left + (step / colours.length) * box.width);
    context.fillStyle = colour;
    context.fillRect(border(k), y, border(k + 1) - border(k), thick);
  });
  const ink = themed("ink");
  context.strokeStyle = context.fillStyle = ink;
  context.strokeRect(box.left, y, box.width, thick);
  context.font = `13px ${FONT}`;
  context.textAlign = "center";
  // The limit first; what would touch a number before it is left out.
  const isCentre = ([value]) => value === layer.scale.centre;
  const taken = [];
  for (const tick of [...layer.ticks].sort((a, b) => isCentre(b) - isCentre(a))) {
    const [value, label] = tick;
    const x = box.left + position(layer.scale, value) * box.width;
    context.font = `${isCentre(tick) ? "bold " : ""}13px ${FONT}`;
    const half = 0.5 * context.measureText(label).width + 4;
    const colour = isCentre(tick) ? "#1b1f24" : ink;
    drawLine(context, x, isCentre(tick) ? y : y + thick, x, y + thick + 4, [], colour);
    if (taken.some(([low, high]) => x + half > low && x - half < high)) continue;
    taken.push([x - half, x + half]);
    const room = [box.left - 20 + half, right + margin - half];
    context.fillText(label, Math.min(Math.max(x, room[0]), room[1]), y + thick + 18);
  }
  context.font = `13px ${FONT}`;
  context.fillText(layer.label, box.left + box.width / 2, y + thick + 38, box.width + 50);
}

// Slanted lines, on a ground of that colour or on what is there: each a colour and a width.
// A finer one is for areas that could lie between the lines.
function hatching(context, ground, { lines = [["#1b1f24", 1]], falling = false, side = 8 } = {}) {
  const tile = element("canvas", { width: side, height: side });
  const brush = tile.getContext("2d");
  if (ground) {
    brush.fillStyle = ground;
    brush.fillRect(0, 0, side, side);
  }
  brush.beginPath();
  for (const shift of [-side, 0, side]) {
    brush.moveTo(shift, falling ? 0 : side);
    brush.lineTo(shift + side, falling ? side : 0);
  }
  for (const [colour, width] of lines) {
    brush.strokeStyle = colour;
    brush.lineWidth = (width * side) / 8;
    brush.stroke();
  }
  return context.createPattern(tile, "repeat");
}

// Frame, ticks and labels of a map; `at` are the places of values on the screen.
function drawMapAxes(context, box, [xAxis, yAxis], view, [toX, toY]) {
  const ink = themed("ink");
  context.strokeStyle = context.fillStyle = ink;
  context.lineWidth = 1;
  context.strokeRect(box.left, box.top, box.width, box.height);
  context.font = `13px ${FONT}`;
  const range = (axis, k) => view[k].map((even) => (axis.log ? Math.exp(even) : even));
  const bottom = box.top + box.height;
  context.textAlign = "center";
  for (const [value, label] of ticks(...range(xAxis, 0), box.width / 90, xAxis.ticks)) {
    const x = toX(value);
    drawLine(context, x, bottom, x, bottom + 5, [], ink);
    context.fillText(label, x, bottom + 19);
  }
  context.textAlign = "right";
  for (const [value, label] of ticks(...range(yAxis, 1), box.height / 55, yAxis.ticks)) {
    const y = toY(value);
    drawLine(context, box.left - 5, y, box.left, y, [], ink);
    context.fillText(label, box.left - 8, y + 4.5);
  }
  context.font = `15px ${FONT}`;
  context.textAlign = "center";
  context.fillText(withUnit(xAxis.words, xAxis.unit), box.left + box.width / 2, bottom + 42);
  context.save();
  context.translate(17, box.top + box.height / 2);
  context.rotate(-Math.PI / 2);
  context.fillText(withUnit(yAxis.words, yAxis.unit), 0, 0);
  context.restore();
}
