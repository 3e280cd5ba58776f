// The triangle of a map around a point, as the engine computes it.

// The point, limited to the map as in the engine; NaN becomes zero.
const within = (value, most) => (value > 0 ? Math.min(value, most) : 0);

// The triangle around the point and the weight of each corner: none negative, their sum 1. null if there is no
// triangle.
export function locate({ points, triangles }, speed, force) {
    const most = points.reduce(([s, f], [a, b]) => [Math.max(s, a), Math.max(f, b)], [0, 0]);
    const [x, y] = [within(speed, most[0]), within(force, most[1])];
    let best = null;
    for (const triangle of triangles) {
        const weights = weightsIn(
            triangle.map((i) => points[i]),
            x,
            y,
        );
        const least = Math.min(...weights);
        if (!(least <= best?.least)) best = { least, triangle, weights };
        if (least >= 0) break;
    }
    if (!best) return null;
    const positive = best.weights.map((weight) => Math.max(0, weight));
    const sum = positive.reduce((all, weight) => all + weight, 0);
    return {
        x,
        y,
        clamped: x !== speed || y !== force,
        corners: best.triangle.map((i, k) => ({ vertex: i, point: points[i], weight: positive[k] / sum })),
    };
}

// Barycentric weights of a point; one or more are negative outside the triangle.
function weightsIn([[ax, ay], [bx, by], [cx, cy]], x, y) {
    const area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay);
    const second = ((x - ax) * (cy - ay) - (cx - ax) * (y - ay)) / area;
    const third = ((bx - ax) * (y - ay) - (x - ax) * (by - ay)) / area;
    return [1 - second - third, second, third];
}
