// Programs and textures of WebGL2, with errors in words.

/** Compiles and links two shaders; `uniforms` of the result are the places of all uniforms by name. */
export function makeProgram(gl, vertex, fragment) {
  const program = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
    const logs = gl.getAttachedShaders(program).map((shader) => gl.getShaderInfoLog(shader));
    throw new Error(`The graphics driver refuses a shader: ${logs.join(" ")} ${gl.getProgramInfoLog(program)}`);
  }
  const uniforms = {};
  const count = gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS) ?? 0;
  for (let i = 0; i < count; i++) {
    const { name } = gl.getActiveUniform(program, i);
    uniforms[name] = gl.getUniformLocation(program, name);
  }
  return { program, uniforms };
}

/**
 * A texture; shaders fetch single texels of it, or a filter mixes them up to its edge.
 *
 * @param {number[]} format internal format, format and type.
 * @param {number[]} size width, height, and layers of an array of textures, or depth of a solid one.
 * @param {ArrayBufferView|null} data null leaves it empty.
 * @param {object} more `filter`, and `isSolid`.
 */
export function makeTexture(gl, format, size, data, { filter = gl.NEAREST, isSolid = false } = {}) {
  const [internal, channels, type] = format;
  const target = isSolid ? gl.TEXTURE_3D : size.length === 3 ? gl.TEXTURE_2D_ARRAY : gl.TEXTURE_2D;
  const most = gl.getParameter(isSolid ? gl.MAX_3D_TEXTURE_SIZE : gl.MAX_TEXTURE_SIZE);
  const largest = Math.max(...size.slice(0, isSolid ? 3 : 2));
  if (largest > most) {
    throw new Error(`This scene needs textures of ${largest} texels a side; the graphics driver has at most ${most}.`);
  }
  const texture = gl.createTexture();
  gl.bindTexture(target, texture);
  gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
  const upload = size.length === 3 ? gl.texImage3D : gl.texImage2D;
  upload.call(gl, target, 0, internal, ...size, 0, channels, type, data);
  for (const key of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(target, key, filter);
  for (const key of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T, gl.TEXTURE_WRAP_R]) gl.texParameteri(target, key, gl.CLAMP_TO_EDGE);
  return { texture, target };
}
