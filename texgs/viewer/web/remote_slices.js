// The server's slices of the scene's volume, see `Slices`.

/** @param {{planes: object[], window: number[]}} facts - of the greeting */
export function remoteSlices({ planes, window }) {
  const ask = async (path) => {
    const answer = await fetch(path);
    if (!answer.ok) throw new Error(await answer.text());
    return answer;
  };
  const query = (name, values) => new URLSearchParams({ [name]: JSON.stringify(values) });
  return {
    planes,
    window,
    async slice(plane, number, shown) {
      const answer = await ask(`slice.png?${query("slice", { plane: planes.indexOf(plane), number, window: shown })}`);
      return createImageBitmap(await answer.blob(), { colorSpaceConversion: "none" });
    },
    async place(point) {
      return (await ask(`place.json?${query("place", { point })}`)).json();
    },
  };
}
