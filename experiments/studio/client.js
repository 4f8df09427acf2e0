// What a picture takes, on the clock of the browser that shows it, and where the browser's own buttons lead.
window.studio = {
  keeps: false, // whether the page holds what no file holds
  waiting: [], // when the hand moved, for the movements that no picture shows yet
  pictures: [], // what each picture took, as `draw` notes it
  moved(id, value) {
    getHtmlElement(id)?.setAttribute("aria-valuenow", value); // Vue does so when the server has told it
    const now = window.event?.timeStamp ?? performance.now();
    this.waiting.push(now);
    if (this.waiting.length > 1000) this.waiting.shift();
    return now;
  },
  at(view) {
    // Each view is a step of the browser's history, so that "back" shows the view before and does not leave the page
    const now = history.state?.view;
    if (now !== view) history[now ? "pushState" : "replaceState"]({ view }, "");
  },
  say(texts) {
    // Into the node that Vue made, so that Vue finds it again
    for (const [id, text] of Object.entries(texts)) {
      const node = getHtmlElement(id)?.firstChild;
      if (node) node.nodeValue = text;
    }
  },
  async draw(id, change, moved, spent) {
    const began = performance.now();
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
    const now = performance.now();
    const took = now - moved;
    const seen = this.waiting.filter((stamp) => stamp <= moved).map((stamp) => now - stamp);
    this.waiting = this.waiting.filter((stamp) => stamp > moved);
    const transport = took - spent.wait - spent.compute - spent.encode - (now - began);
    this.pictures.push({ took, seen, ...spent, transport, draw: now - began });
    if (this.pictures.length > 1000) this.pictures.shift();
    return took;
  },
};
window.addEventListener("popstate", (event) => event.state?.view && emitEvent("studio_view", event.state.view));
window.addEventListener("beforeunload", (event) => studio.keeps && event.preventDefault());
