// Amplitudes of a motion's frequencies, by a fast Fourier transform.

// Of a power of two of complex numbers: [their real parts, their imaginary ones].
function transformed([re, im]) {
  const half = re.length / 2;
  if (half < 1) return [re, im];
  const every = (odd) => [re, im].map((part) => part.filter((_, k) => k % 2 === odd));
  const [[a, b], [c, d]] = [transformed(every(0)), transformed(every(1))];
  const found = [new Float64Array(2 * half), new Float64Array(2 * half)];
  for (let k = 0; k < half; k++) {
    const [cos, sin] = [Math.cos((Math.PI * k) / half), -Math.sin((Math.PI * k) / half)];
    const [x, y] = [c[k] * cos - d[k] * sin, c[k] * sin + d[k] * cos];
    [found[0][k], found[1][k]] = [a[k] + x, b[k] + y];
    [found[0][k + half], found[1][k + half]] = [a[k] - x, b[k] - y];
  }
  return found;
}

// Of values `every` s apart within a window, by Hann's weights: the amplitude that a steady motion
// of each frequency would have. Without all values there is none.
function spectrum(values, every, bins) {
  const size = spectrumSize(values.length);
  const weighted = [new Float64Array(size), new Float64Array(size)];
  if (!values.every(Number.isFinite)) return new Float32Array(bins).fill(NaN);
  const mean = values.reduce((sum, value) => sum + value, 0) / values.length;
  values.forEach((value, k) => {
    const turn = (2 * Math.PI * k) / (values.length - 1);
    weighted[0][k] = (value - mean) * (0.5 - 0.5 * Math.cos(turn));
  });
  const [re, im] = transformed(weighted);
  // The weights' mean is a half, and half of the motion is at negative frequencies.
  const scale = 4 / values.length;
  return Float32Array.from({ length: bins }, (_, k) => scale * Math.hypot(re[k], im[k]));
}

// Twice as long, at least: lines between those of the window itself.
function spectrumSize(count) {
  return 2 ** Math.ceil(Math.log2(2 * count));
}
