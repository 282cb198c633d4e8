// Colour scales and their bars, and hatches.

// Returns the position of a value on a colour scale, from 0 to 1; both sides of its middle have
// half the colours.
function position(scale, value) {
  const coordinate = scale.log ? Math.log : (x) => x;
  const [low, middle, high] = scale.stops.map(coordinate);
  const offset = coordinate(value) - middle;
  const fraction = 0.5 + (0.5 * offset) / (offset < 0 ? middle - low : high - middle);
  return Math.min(Math.max(fraction, 0), 1);
}

// Draws the colour bar below a map, `margin` px from the figure's edge.
function drawColourBar(context, box, layer, margin) {
  const [y, thickness, right] = [box.top + box.height + 72, 16, box.left + box.width];
  const { colours } = layer;
  colours.forEach((colour, k) => {
    const border = (step) => Math.round(box.left + (step / colours.length) * box.width);
    context.fillStyle = colour;
    context.fillRect(border(k), y, border(k + 1) - border(k), thickness);
  });
  context.strokeStyle = themeColour("ink");
  context.strokeRect(box.left, y, box.width, thickness);
  // The limit is labelled first; a number that would touch an earlier one is omitted.
  const isCentre = ([value]) => value === layer.scale.limit;
  const labelRanges = [];
  context.font = `bold 13px ${FONT}`;
  for (const tick of [...layer.ticks].sort((a, b) => isCentre(b) - isCentre(a))) {
    const [value, label] = tick;
    const x = box.left + position(layer.scale, value) * box.width;
    const halfWidth = 0.5 * context.measureText(label).width + 4;
    const [from, colour] = isCentre(tick) ? [y, DARK] : [y + thickness, themeColour("ink")];
    drawLine(context, x, from, x, y + thickness + 4, [], colour);
    if (labelRanges.some(([low, high]) => x + halfWidth > low && x - halfWidth < high)) continue;
    labelRanges.push([x - halfWidth, x + halfWidth]);
    const xRange = [box.left - 20 + halfWidth, right + margin - halfWidth];
    write(context, label, Math.min(Math.max(x, xRange[0]), xRange[1]), y + thickness + 18,
      { bold: isCentre(tick) ? "bold" : "" });
  }
  const middle = box.left + box.width / 2;
  write(context, layer.label, middle, y + thickness + 38, { room: box.width + 50 });
}

// Creates a pattern of slanted lines, each of a colour and a width, on a ground of a colour or on
// a transparent one. `side` is the size of the pattern (px), which must be small enough that no
// area lies between two lines.
function createHatchPattern(context, groundColour, options = {}) {
  const { lines = [[DARK, 1]], falling = false, side = 8 } = options;
  const tile = element("canvas", { width: side, height: side });
  const tileContext = tile.getContext("2d");
  tileContext.fillStyle = groundColour ?? "transparent";
  tileContext.fillRect(0, 0, side, side);
  tileContext.beginPath();
  for (const offset of [-side, 0, side]) {
    tileContext.moveTo(offset, falling ? 0 : side);
    tileContext.lineTo(offset + side, falling ? side : 0);
  }
  for (const [colour, width] of lines) {
    tileContext.strokeStyle = colour;
    tileContext.lineWidth = (width * side) / 8;
    tileContext.stroke();
  }
  return context.createPattern(tile, "repeat");
}
