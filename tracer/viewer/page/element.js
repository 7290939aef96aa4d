// What all parts of the page need: a new element with its properties and children.

export const element = (tag, properties = {}, ...children) => {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
};

// Says something below the picture; `kind`: nothing, or "problem".
export const tell = (text, kind = "") => Object.assign(document.getElementById("notice"), { textContent: text, className: kind });
