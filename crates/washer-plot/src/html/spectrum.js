// Spectra of motions by a fast Fourier transform.

// Returns the Fourier transform of complex numbers, [real parts, imaginary parts], whose count is a
// power of two.
function fourierTransform([re, im]) {
  const halfSize = re.length / 2;
  if (halfSize < 1) return [re, im];
  const everySecond = (odd) => [re, im].map((part) => part.filter((_, k) => k % 2 === odd));
  const [evenRe, evenIm] = fourierTransform(everySecond(0));
  const [oddRe, oddIm] = fourierTransform(everySecond(1));
  const result = [new Float64Array(2 * halfSize), new Float64Array(2 * halfSize)];
  for (let k = 0; k < halfSize; k++) {
    const [cos, sin] = [Math.cos((Math.PI * k) / halfSize), -Math.sin((Math.PI * k) / halfSize)];
    const [turnedRe, turnedIm] = [oddRe[k] * cos - oddIm[k] * sin, oddRe[k] * sin + oddIm[k] * cos];
    result[0][k] = evenRe[k] + turnedRe;
    result[1][k] = evenIm[k] + turnedIm;
    result[0][k + halfSize] = evenRe[k] - turnedRe;
    result[1][k + halfSize] = evenIm[k] - turnedIm;
  }
  return result;
}

// Returns the amplitude of a steady motion of each frequency for values `intervalS` s apart in a
// window, with Hann's weights; none if values are missing.
function spectrum(values, intervalS, bins) {
  const size = spectrumSize(values.length);
  const weightedValues = [new Float64Array(size), new Float64Array(size)];
  if (!values.every(Number.isFinite)) return new Float32Array(bins).fill(NaN);
  const mean = values.reduce((sum, value) => sum + value, 0) / values.length;
  values.forEach((value, k) => {
    const angle = (2 * Math.PI * k) / (values.length - 1);
    weightedValues[0][k] = (value - mean) * (0.5 - 0.5 * Math.cos(angle));
  });
  const [re, im] = fourierTransform(weightedValues);
  // The mean of the weights is a half, and half of the motion is at negative frequencies.
  const scale = 4 / values.length;
  return Float32Array.from({ length: bins }, (_, k) => scale * Math.hypot(re[k], im[k]));
}

// The transform is at least twice as long as the window, for lines between its own.
function spectrumSize(count) {
  return 2 ** Math.ceil(Math.log2(2 * count));
}
