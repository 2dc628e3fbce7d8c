// Long lists: only what is in sight is drawn.
import {useEffect, useState} from "./html.js";

export const ROW = 34;
const BEYOND = 6;

/** Which part of a list is in sight; only that is drawn. */
export function useWindow(ref, count, height, columns) {
  const [place, setPlace] = useState({top: 0, view: 600});
  useEffect(() => {
    const box = ref.current;
    const read = () => setPlace({top: box.scrollTop, view: box.clientHeight});
    read();
    box.addEventListener("scroll", read, {passive: true});
    const observer = new ResizeObserver(read);
    observer.observe(box);
    return () => { box.removeEventListener("scroll", read); observer.disconnect(); };
  }, []);
  const lines = Math.ceil(count / columns);
  const first = Math.max(0, Math.min(Math.floor(place.top / height) - BEYOND, lines));
  const last = Math.min(lines, Math.ceil((place.top + place.view) / height) + BEYOND);
  return {first: first * columns, last: Math.min(count, last * columns), before: first * height, after: (lines - last) * height};
}
