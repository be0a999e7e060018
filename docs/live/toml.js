// A reader of TOML as robot files use it: tables, dotted keys, texts, numbers, inline tables.

import { PageError } from "live/data.js";

const KEY = /[A-Za-z0-9_-]+|"[^"\\]*"|'[^']*'/y;
const NUMBER = /[+-]?(?:\d[\d_]*)(?:\.[\d_]+)?(?:[eE][+-]?\d+)?(?![\w.:-])/y;
const WORDS = { true: true, false: false };

class Line {
  constructor(text, say) {
    this.text = text;
    this.at = 0;
    this.say = say;
  }

  fail() {
    throw new PageError(`${this.say} is no TOML that this page reads (tables, texts, numbers and`
      + ` inline tables, each on one line): ${this.text.trim()}`);
  }

  skip() { while (/[ \t]/.test(this.text[this.at] ?? "")) this.at += 1; }

  // Take a text if it comes next.
  take(text) {
    this.skip();
    if (!this.text.startsWith(text, this.at)) return false;
    this.at += text.length;
    return true;
  }

  match(pattern) {
    this.skip();
    pattern.lastIndex = this.at;
    const found = pattern.exec(this.text)?.[0];
    if (found !== undefined) this.at = pattern.lastIndex;
    return found;
  }

  end() {
    this.skip();
    if (this.at < this.text.length && this.text[this.at] !== "#") this.fail();
  }

  keys() {
    const keys = [];
    do keys.push((this.match(KEY) ?? this.fail()).replace(/^["']|["']$/g, ""));
    while (this.take("."));
    return keys;
  }

  value() {
    if (this.take("{")) return this.inline();
    if (this.text.startsWith('"""', this.at) || this.text.startsWith("'''", this.at)) this.fail();
    const basic = this.match(/"(?:[^"\\]|\\.)*"/y);
    if (basic !== undefined) {
      try {
        return JSON.parse(basic);
      } catch {
        this.fail();
      }
    }
    const literal = this.match(/'[^']*'/y);
    if (literal !== undefined) return literal.slice(1, -1);
    const number = this.match(NUMBER);
    if (number !== undefined) return Number(number.replaceAll("_", ""));
    return WORDS[this.match(/true|false/y)] ?? this.fail();
  }

  inline() {
    const table = {};
    if (this.take("}")) return table;
    do this.pair(table);
    while (this.take(","));
    if (!this.take("}")) this.fail();
    return table;
  }

  // Read `key = value` into a table.
  pair(table) {
    const keys = this.keys();
    if (!this.take("=")) this.fail();
    const inner = this.table(table, keys.slice(0, -1));
    const key = keys.at(-1);
    if (Object.hasOwn(inner, key)) {
      throw new PageError(`${this.say} states '${keys.join(".")}' for the second time.`);
    }
    this.skip();
    inner[key] = this.value();
  }

  table(root, keys) {
    let table = root;
    for (const key of keys) {
      if (!Object.hasOwn(table, key)) table[key] = {};
      table = table[key];
      if (typeof table !== "object") this.fail();
    }
    return table;
  }
}

// Return the tables of a file's text; messages name `origin`.
export function parseToml(text, origin) {
  const root = {};
  let table = root;
  text.split(/\r?\n/).forEach((content, index) => {
    const line = new Line(content, `${origin}: line ${index + 1}`);
    line.skip();
    if (line.at === content.length || content[line.at] === "#") return;
    if (line.take("[")) {
      const keys = line.keys();
      if (!line.take("]")) line.fail();
      table = line.table(root, keys);
    } else line.pair(table);
    line.end();
  });
  return root;
}
