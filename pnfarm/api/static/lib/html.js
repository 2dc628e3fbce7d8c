// Preact with HTM: components as functions, markup as tagged templates.
import {h, render} from "preact";
import htm from "htm";

export const html = htm.bind(h);
export {render};
export {useEffect, useMemo, useRef, useState} from "preact/hooks";
