// Amplitudes of a motion's frequencies, by a fast Fourier transform.

// In place, of a power of two.
function transform(re, im) {
  const count = re.length;
  for (let k = 1, j = 0; k < count; k++) {
    let bit = count >> 1;
    for (; j & bit; bit >>= 1) j ^= bit;
    j ^= bit;
    if (k < j) {
      [re[k], re[j]] = [re[j], re[k]];
      [im[k], im[j]] = [im[j], im[k]];
    }
  }
  for (let size = 2; size <= count; size *= 2) {
    const angle = (-2 * Math.PI) / size;
    for (let start = 0; start < count; start += size) {
      for (let k = 0; k < size / 2; k++) {
        const [cos, sin] = [Math.cos(angle * k), Math.sin(angle * k)];
        const [a, b] = [start + k, start + k + size / 2];
        const [x, y] = [re[b] * cos - im[b] * sin, re[b] * sin + im[b] * cos];
        [re[b], im[b]] = [re[a] - x, im[a] - y];
        [re[a], im[a]] = [re[a] + x, im[a] + y];
      }
    }
  }
}

// Of values `every` s apart within a window, by Hann's weights: the amplitude that a steady motion
// of each frequency would have. Without all values there is none.
function spectrum(values, every, bins) {
  const size = spectrumSize(values.length);
  const [re, im] = [new Float64Array(size), new Float64Array(size)];
  if (!values.every(Number.isFinite)) return new Float32Array(bins).fill(NaN);
  const mean = values.reduce((sum, value) => sum + value, 0) / values.length;
  values.forEach((value, k) => {
    re[k] = (value - mean) * (0.5 - 0.5 * Math.cos((2 * Math.PI * k) / (values.length - 1)));
  });
  transform(re, im);
  // The weights' mean is a half, and half of the motion is at negative frequencies.
  const scale = 4 / values.length;
  return Float32Array.from({ length: bins }, (_, k) => scale * Math.hypot(re[k], im[k]));
}

// Twice as long, at least: lines between those of the window itself.
function spectrumSize(count) {
  return 2 ** Math.ceil(Math.log2(2 * count));
}
