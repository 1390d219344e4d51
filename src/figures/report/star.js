// The star as it turns: maps of rings of pixels on a canvas, seen at the star's inclination.
(() => {
  const data = JSON.parse(document.getElementById("star-data").textContent);
  const canvas = document.getElementById("star");
  const button = document.getElementById("star-play"), slider = document.getElementById("star-time");
  const told = document.getElementById("star-told");
  const size = canvas.width, half = size / 2, radius = half * 0.9, turn = 2 * Math.PI;
  const context = canvas.getContext("2d"), image = context.createImageData(size, size);
  const colours = data.colours.map(hex => [0, 2, 4].map(k => parseInt(hex.slice(k, k + 2), 16)));
  const maps = data.maps.map(map => ({ ...map, steps: Array.from(map.pixels, c => c.charCodeAt(0) - data.first) }));
  const total = maps[0].steps.length, starts = [0];
  data.rings.forEach((count, k) => starts.push(starts[k] + count));
  const sini = Math.sin(data.inclination), cosi = Math.cos(data.inclination);

  // what does not change: for each pixel of the picture the ring, the angle from the central meridian, the rotation
  const seen = [];
  for (let row = 0; row < size; row++) {
    for (let column = 0; column < size; column++) {
      const x = (column + 0.5 - half) / radius, y = (half - row - 0.5) / radius, r2 = x * x + y * y;
      if (r2 >= 1) continue;
      const z = Math.sqrt(1 - r2), sinb = y * sini + z * cosi;
      let ring = 0;
      const place = (sinb + 1) / 2 * total;
      while (ring < data.rings.length - 1 && place >= starts[ring + 1]) ring++;
      seen.push({
        at: 4 * (row * size + column), start: starts[ring], count: data.rings[ring],
        psi: Math.atan2(x, z * sini - y * cosi), omega: data.equator - data.shear * sinb * sinb,
        // darker to the limb, and softer at the edge of the disc
        light: 0.55 + 0.45 * z, alpha: Math.min(1, (1 - Math.sqrt(r2)) * radius),
        line: Math.abs(sinb) < 0.012,
      });
    }
  }

  const steps = (map, pixel, time) => {
    const angle = (pixel.psi - pixel.omega * (time - map.epoch)) / turn;
    return map.steps[pixel.start + Math.min(pixel.count - 1, Math.floor((angle - Math.floor(angle)) * pixel.count))];
  };
  const draw = time => {
    let next = maps.findIndex(map => map.time > time);
    if (next < 0) next = maps.length - 1;
    const before = Math.max(0, next - 1), apart = maps[next].time - maps[before].time;
    // between maps of a season, where longitudes count from the same time, values are interpolated
    const same = maps[next].epoch === maps[before].epoch && apart > 0;
    let share = same ? Math.min(1, Math.max(0, (time - maps[before].time) / apart)) : 0;
    const near = Math.abs(maps[next].time - time) < Math.abs(maps[before].time - time) ? next : before;
    const [a, b] = same ? [maps[before], maps[next]] : [maps[near], maps[near]];
    for (const pixel of seen) {
      let value = steps(a, pixel, time);
      if (share > 0) value += share * (steps(b, pixel, time) - value);
      const colour = colours[Math.round(value)], light = pixel.line ? 0.8 * pixel.light : pixel.light;
      for (let k = 0; k < 3; k++) image.data[pixel.at + k] = colour[k] * light;
      image.data[pixel.at + 3] = 255 * pixel.alpha;
    }
    context.putImageData(image, 0, 0);
    // the visible pole, and the axis above it
    context.strokeStyle = "#555";
    context.lineWidth = 1.5;
    context.beginPath();
    context.moveTo(half, half - radius * sini);
    context.lineTo(half, half - radius * sini - 0.085 * size);
    context.stroke();
    const cycle = (time - data.rotation_epoch) * data.omega / turn;
    told.textContent = `${time.toFixed(2)} d, phase ${(cycle - Math.floor(cycle)).toFixed(2)}`;
  };

  // the slider goes through all spans of time, one after the other
  const lengths = data.spans.map(([from, to]) => to - from), whole = lengths.reduce((a, b) => a + b, 0);
  const time = share => {
    let left = share * whole;
    for (let k = 0; k < lengths.length; k++) {
      if (left <= lengths[k] || k === lengths.length - 1) return data.spans[k][0] + left;
      left -= lengths[k];
    }
  };
  const show = () => draw(time(Number(slider.value) / 1000));
  const rotation = 8000; // ms
  let last = null, frame = null;
  const move = now => {
    if (last !== null) {
      const share = Number(slider.value) / 1000 + (now - last) / rotation * turn / data.omega / whole;
      slider.value = 1000 * (share % 1);
      show();
    }
    last = now;
    frame = requestAnimationFrame(move);
  };
  const play = on => {
    if (!on && frame !== null) cancelAnimationFrame(frame);
    frame = last = null;
    if (on) frame = requestAnimationFrame(move);
    button.textContent = on ? "Pause" : "Turn";
  };
  button.addEventListener("click", () => play(frame === null));
  slider.addEventListener("input", () => { play(false); show(); });
  show();
  play(!matchMedia("(prefers-reduced-motion: reduce)").matches);
})();
