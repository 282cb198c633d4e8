// Spectra of motions by a fast Fourier transform.

// Returns the Fourier transform of complex numbers, [real parts, imaginary parts], whose count is a
// power of two.
function fourierTransform([re, im]) {
  const half = re.length / 2;
  if (half < 1) return [re, im];
  const elements = (odd) => [re, im].map((part) => part.filter((_, k) => k % 2 === odd));
  const [[a, b], [c, d]] = [fourierTransform(elements(0)), fourierTransform(elements(1))];
  const result = [new Float64Array(2 * half), new Float64Array(2 * half)];
  for (let k = 0; k < half; k++) {
    const [cos, sin] = [Math.cos((Math.PI * k) / half), -Math.sin((Math.PI * k) / half)];
    const [x, y] = [c[k] * cos - d[k] * sin, c[k] * sin + d[k] * cos];
    [result[0][k], result[1][k]] = [a[k] + x, b[k] + y];
    [result[0][k + half], result[1][k + half]] = [a[k] - x, b[k] - y];
  }
  return result;
}

// Returns the amplitude of a steady motion of each frequency for values `intervalS` s apart in a
// window, with Hann's weights; none if values are missing.
function spectrum(values, intervalS, bins) {
  const size = spectrumSize(values.length);
  const weighted = [new Float64Array(size), new Float64Array(size)];
  if (!values.every(Number.isFinite)) return new Float32Array(bins).fill(NaN);
  const mean = values.reduce((sum, value) => sum + value, 0) / values.length;
  values.forEach((value, k) => {
    const turn = (2 * Math.PI * k) / (values.length - 1);
    weighted[0][k] = (value - mean) * (0.5 - 0.5 * Math.cos(turn));
  });
  const [re, im] = fourierTransform(weighted);
  // The mean of the weights is a half, and half of the motion is at negative frequencies.
  const scale = 4 / values.length;
  return Float32Array.from({ length: bins }, (_, k) => scale * Math.hypot(re[k], im[k]));
}

// The transform is at least twice as long as the window, for lines between its own.
function spectrumSize(count) {
  return 2 ** Math.ceil(Math.log2(2 * count));
}
