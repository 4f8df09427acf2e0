// What a picture takes, on the clock of the browser that shows it.
window.studio = {
  times: [],
  async draw(id, change, moved) {
    for (let tries = 0; !getElement(id)?.chart; tries++) {
      if (tries === 50) return null; // the view has changed meanwhile
      await new Promise((resolve) => setTimeout(resolve, 20)); // it is being made
    }
    getElement(id).chart.setOption(change);
    await new Promise((resolve) => {
      requestAnimationFrame(() => setTimeout(resolve));
      setTimeout(resolve, 200); // a tab in the background has no frames
    });
    if (moved === null) return null;
    const took = performance.now() - moved;
    this.times.push(took);
    if (this.times.length > 1000) this.times.shift();
    return took;
  },
};
