// What the server says: the latest content of each part of the page, see board.py, and the functions that show it.
//
//   show("head", (head) => ...)   is called with each new content of a part, and at once if there is one
//   latest("head")                is the content that the part has now; undefined: none has come
const contents = {};
const shows = {};

export const latest = (name) => contents[name];

// `again`: in place of the functions before.
export function show(name, shown, again = false) {
  if (again) shows[name] = [];
  (shows[name] ??= []).push(shown);
  if (name in contents) shown(contents[name]);
}

export function put(name, content) {
  contents[name] = content;
  for (const shown of shows[name] ?? []) shown(content);
}
