// The value of a field: the server's, a value that was sent and has not come back, or a value that is being typed.

export const text = (value) => (typeof value === "number" ? String(Number(value.toPrecision(10))) : String(value));

export class FieldValue {
  value; // of the server
  of; // number of the row whose field it is
  sent; // text of the server's value when another one was sent; undefined: none is on its way
  isTyped = false; // whether something is in the box that does not count yet
  isShown = false;

  get isSent() {
    return this.sent !== undefined;
  }

  // The field is now of this row; return whether it was of another row, whose changes are dropped.
  turnTo(of) {
    const isOther = this.of !== undefined && this.of !== of;
    this.of = of;
    if (isOther) {
      this.forget();
      this.isShown = false;
    }
    return isOther;
  }

  // Take the server's value, and return whether the control has to show it.
  receive(value) {
    const isNew = this.isSent || !this.isShown || text(this.value ?? "") !== text(value);
    this.value = value;
    if (this.isSent && text(value) === this.sent) return false; // the value that was sent is not there yet
    this.sent = undefined;
    this.isShown = true;
    return isNew && !this.isTyped;
  }

  // Another value is sent: what was chosen stays in sight until the server's one changes.
  send() {
    this.isTyped = false;
    this.sent = text(this.value);
  }

  // Drop what was typed or sent.
  forget() {
    this.sent = undefined;
    this.isTyped = false;
  }
}
