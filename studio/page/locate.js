// The triangle of a map around a point, as the engine computes it.

const LEAST_WEIGHT = 1e-6;
const SPIKES = 6; // points of a trail that do not widen an axis, such as those of an impact

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

// The recorded range, [[least, most] speed, [least, most] force]: that of the models which are not beyond it.
export function recordedRange({ points, kinds }) {
    const recorded = points.filter((_, i) => kinds[i] !== "edge");
    const of = (axis) => (recorded.length ? recorded : points).map((point) => point[axis]);
    return [0, 1].map((axis) => [Math.min(...of(axis)), Math.max(...of(axis))]);
}

// True for a model beyond what was recorded. Those at no speed or no force are silent, and nothing is extrapolated from them.
export const isBeyond = ({ points, kinds }, vertex) => kinds[vertex] === "edge" && points[vertex][0] > 0 && points[vertex][1] > 0;

// True if a located point is beyond what was recorded.
export const isExtrapolated = (map, { clamped, corners }) =>
    clamped || corners.some(({ vertex, weight }) => weight > LEAST_WEIGHT && isBeyond(map, vertex));

// The ends of the axes: what was recorded and the hand lately, in steps, but no further than the map.
export function axesFor({ points, kinds }, trail) {
    return recordedRange({ points, kinds }).map(([, recorded], axis) => {
        const hand =
            trail
                .map(({ speed, force }) => (axis === 0 ? speed : force))
                .sort((a, b) => a - b)
                .at(-SPIKES) ?? 0;
        const whole = points.reduce((most, point) => Math.max(most, point[axis]), 1e-3);
        return Math.min(whole, recorded * Math.max(1, Math.ceil((2 * hand) / recorded) / 2));
    });
}
