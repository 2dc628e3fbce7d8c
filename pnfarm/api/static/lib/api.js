// Requests to the farm's API.  Errors carry the sentence that the command line would print.

const BASE = "/api/v1/";

/** Path of parts, each encoded. */
export const path = (...parts) => parts.map(encodeURIComponent).join("/");

async function problemOf(answer) {
  if (answer.status === 401) return "the farm's token is not known any more: load the page anew";
  try {
    const {detail, errors} = await answer.json();
    const fields = (errors || []).filter(one => one.field && !detail.includes(one.field)).map(one => `${one.field} ${one.what}`);
    return [detail, ...fields].join("; ");
  } catch {
    return `${answer.status} ${answer.statusText}`;
  }
}

/** The answer; an Error has the status of a refusal. */
export async function call(method, where, body, headers = {}) {
  const options = {method, headers: {...headers}};
  if (body !== undefined) {
    options.headers["Content-Type"] = "application/json";
    options.body = JSON.stringify(body);
  }
  let answer;
  try {
    answer = await fetch(BASE + where, options);
  } catch {
    throw new Error("the farm does not answer: has it stopped?");
  }
  if (!answer.ok) throw Object.assign(new Error(await problemOf(answer)), {status: answer.status});
  return answer.json();
}

export const get = where => call("GET", where);
export const url = where => BASE + where;
