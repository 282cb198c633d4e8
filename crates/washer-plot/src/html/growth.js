// The panel's point at constant speeds: the growth of small disturbances, and the amplitudes of the
// attractors.

// The least speed (rpm); the number of speeds, about, and of those in a call: for a machine whose
// growth takes long to compute, and for others.
const GROWTH = { from: 50, slow: [24, 1], quick: [300, 10] };

// The numbers of the fastest disturbance at each speed: growth (1/s), frequency (cycles per
// minute), kind, and whether the response is on the curve of a machine that runs up.
async function growthAt(pool, kind, values, speeds) {
  const urgency = kind === "check" ? 1 : 0;
  const { numbers } = await pool.ask(kind, urgency, "growth", [...values, ...speeds],
    [values.length]);
  return Array.from(speeds, (_, k) => numbers.slice(1 + 4 * k, 5 + 4 * k));
}

// Returns the note on speeds at which the response is off that curve.
function toldOffCurve(speeds, isOnCurve) {
  const off = Array.from(speeds).filter((_, k) => isOnCurve[k] === 0);
  const told = off.map((rpm) => significant(rpm)).join(", ");
  return told && ` Off the curve of responses at ${told} rpm: a machine that runs up may be in `
    + "another motion there.";
}

// The map's own metrics of constant speeds, each with its words and numbers.
const HELD = {
  async growth(pool, values, { heldSpeedsRpm: speeds }) {
    const found = await growthAt(pool, "check", values, speeds);
    const growth = found.map((one) => one[0]);
    const most = Math.max(...growth.filter(Number.isFinite));
    return [Number.isFinite(most) ? `Growth at most ${significant(most, 3)} /s, at `
      + `${significant(speeds[growth.indexOf(most)])} rpm of ${speeds.length} constant speeds.`
      + toldOffCurve(speeds, found.map((one) => one[3]))
      : "No response at any of the map's constant speeds.", [most]];
  },
  async dwell(pool, values, { heldSpeedsRpm: speeds, channels, motions }) {
    const point = [...values, ...speeds];
    const { numbers } = await pool.ask("check", 1, "dwell", point, [values.length]);
    const [, speed, motion, ...most] = numbers;
    const far = channels.map(({ words, unit, factor }, k) => `${words} `
      + `${significant(most[k] * factor, 3)} ${unit}`);
    return [Number.isNaN(speed) ? "No motion was found at any of the map's constant speeds."
      : `Held at ${speeds.length} constant speeds, it goes as far as ${far.join(", ")}; the tub `
        + `turns farthest at ${significant(speed)} rpm (${motions[motion]}).`, most];
  },
};

function createGrowth(host, live, pool) {
  const find = furnish(host, "growth");
  const [box, about, chartHost] = ["#live-growth", "#growth-status", "#live-growth-chart"]
    .map(find);
  box.addEventListener("toggle", compute);
  const [count, together] = live.hasSlowGrowth ? GROWTH.slow : GROWTH.quick;
  let point = null;
  let isDone = true;
  let asked = 0;

  // The speeds, in whole steps, up to the fastest of the spin.
  function speedsUpTo(peak) {
    const from = Math.min(GROWTH.from, peak / 4);
    const step = Math.max(1, Math.round((peak - from) / count));
    const length = Math.max(2, 1 + Math.floor((peak - from) / step + 1e-6));
    return Float32Array.from({ length }, (_, k) => from + step * k);
  }

  async function compute() {
    if (!box.open || !point || isDone) return;
    isDone = true;
    asked += 1;
    const of = asked;
    const speeds = speedsUpTo(point.peak);
    const started = performance.now();
    const [y, frequencies] = [0, 1].map(() => new Float32Array(speeds.length).fill(NaN));
    const line = (values) => [{ ...plainLine("", "#0072b2", values), width: 1.6 }];
    const panels = [plainPanel("growth", "Growth", "1/s", true, line(y), 200),
      plainPanel("frequency", "Frequency", "cycles/min", true, line(frequencies), 110)];
    panels[0].levels = [[0, "neither growth nor decay"]];
    const spec = plainChart("Spin speed", "rpm", speeds, panels);
    spec.shadeMeaning = "disturbances grow";
    chartHost.replaceChildren();
    const chart = createChart(chartHost, spec, "Growth of disturbances over speed");
    const [kinds, isOnCurve] = [[], []];
    let left = speeds.length;
    const part = async (k) => {
      const some = speeds.subarray(k, k + together);
      const found = await growthAt(pool, "growth", point.values, some);
      if (of !== asked) return;
      found.forEach((one, at) => {
        [y[k + at], frequencies[k + at], kinds[k + at], isOnCurve[k + at]] = one;
      });
      left -= some.length;
      about.textContent = `Computing: ${left} of ${speeds.length} speeds are left.`;
      chart.changed();
    };
    try {
      const starts = Array.from({ length: Math.ceil(left / together) }, (_, k) => k * together);
      await Promise.all(starts.map(part));
    } catch (error) {
      if (error && of === asked) about.textContent = `It could not be computed: ${error.message}.`;
      return;
    }
    if (of !== asked) return;
    // The ranges of speeds at which disturbances grow.
    const runs = [];
    speeds.forEach((_, k) => {
      if (!(y[k] > 0)) return;
      if (runs.at(-1)?.at(-1) === k - 1) runs.at(-1).push(k);
      else runs.push([k]);
    });
    spec.shades = runs.map((run) => [speeds[run[0]], speeds[run.at(-1)]]);
    chart.changed();
    const grow = runs.map((run) => {
      const most = run.reduce((a, b) => (y[b] > y[a] ? b : a));
      return `from ${significant(speeds[run[0]])} to ${significant(speeds[run.at(-1)])} rpm (`
        + `${live.kinds[kinds[most]]}, at most ${significant(y[most], 3)}/s at `
        + `${significant(speeds[most])} rpm)`;
    });
    const said = grow.length ? `Disturbances grow ${grow.join(", and ")}.`
      : "Disturbances decay at every speed.";
    const seconds = ((performance.now() - started) / 1000).toFixed(1);
    const off = toldOffCurve(speeds, isOnCurve);
    about.textContent = `${said}${off} ${speeds.length} speeds in ${seconds} s.`;
    box.dataset.speeds = speeds.join(" ");
    box.dataset.growth = y.join(" ");
    box.dataset.point = point.values.join(" ");
  }

  return {
    // The point has changed.
    moved() {
      asked += 1;
      pool.drop("growth");
      point = null;
      if (box.open) about.textContent = "The point moves.";
    },
    // The point rests, with this greatest speed.
    rested(values, peak) {
      point = { values, peak };
      isDone = false;
      compute();
    },
  };
}
