// The set-up of the next START that a window keeps, and when it is offered again, see away.js.

// Return what is kept now, and the set-up that is offered; empty: none is.
//   kept: what was kept before; null: nothing
//   next: what START flies, see Next in head.py
export function offered(kept, { server, set_up }) {
  if (kept?.server === server) return { keep: { ...kept, set_up }, offers: "" };
  const keep = { server, first: set_up, set_up };
  // The set-up with which a server begins is not worth a question.
  const isChanged = kept && kept.set_up !== kept.first && kept.set_up !== set_up;
  return { keep, offers: isChanged ? kept.set_up : "" };
}
