// Two connections: commands and states on one, images on the other, so that images never delay commands.

const RETRY = 1000; // ms
export const NO_TOKEN = "no token"; // why the server closes a connection

/** The token of the address; it is removed from the address bar, and kept for a reload of this tab. */
export function readToken() {
  const found = new URLSearchParams(location.hash.slice(1)).get("token");
  if (found) {
    sessionStorage.setItem("token", found);
    history.replaceState(null, "", location.pathname + location.search);
  }
  return found ?? sessionStorage.getItem("token") ?? "";
}

/** A connection that sends the token first and is opened again when it ends; `onClose` gets the server's reason. */
export class Link {
  constructor(path, token, { onMessage, onClose = () => {} }) {
    Object.assign(this, { path, token, onMessage, onClose });
    this.open();
  }

  open() {
    const socket = new WebSocket(`ws://${location.host}${this.path}`);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => socket.send(JSON.stringify({ type: "hello", token: this.token }));
    socket.onmessage = (event) => this.onMessage(event.data);
    socket.onclose = (event) => {
      this.onClose(event.reason);
      setTimeout(() => this.open(), RETRY);
    };
    this.socket = socket;
  }

  get isOpen() {
    return this.socket.readyState === WebSocket.OPEN;
  }

  /** Send a message, if the connection is open, and say whether it is; a message is never kept for later. */
  send(message) {
    if (this.isOpen) this.socket.send(JSON.stringify(message));
    return this.isOpen;
  }
}
