// Where the shapes of a scene are seen from two sides, both in one scale.
const GAP = 8; // px between the sides and around them
const MARGIN = 1.08; // around what has to be seen
const LEAST_MM = 5;
const CLOSE_MM = 14; // across a close-up
const CLOSE_PARTS = [0.4, 0.75]; // of a side across and up
const [ABOVE, BELOW] = [16, 20]; // px for labels in a side

export const SIDES = [
    { name: "front", axes: [0, 2] },
    { name: "above", axes: [0, 1] },
];

// [low, high] in mm along each axis of what has to be seen: the shapes, of planes alone the pad that lies on them.
export function limitsOf({ shapes }, { width_mm, height_mm }) {
    const limits = shapes.map(limitsOfShape).filter(Boolean);
    if (limits.length === 0) {
        const { origin_mm } = shapes.find(({ form }) => form === "plane") ?? { origin_mm: [0, 0, 0] };
        const reach = [width_mm / 2, height_mm / 2, height_mm / 8];
        limits.push([0, 1, 2].map((axis) => [origin_mm[axis] - reach[axis], origin_mm[axis] + reach[axis]]));
    }
    return [0, 1, 2].map((axis) => [
        Math.min(...limits.map((each) => each[axis][0])),
        Math.max(...limits.map((each) => each[axis][1])),
    ]);
}

function limitsOfShape({ form, centre_mm, diameter_mm, size_mm, points_mm }) {
    const around = (size) => centre_mm.map((middle, axis) => [middle - size[axis] / 2, middle + size[axis] / 2]);
    if (form === "sphere") return around([diameter_mm, diameter_mm, diameter_mm]);
    if (form === "box" || form === "room") return around(size_mm);
    if (form !== "mesh" || points_mm.length === 0) return null;
    return [0, 1, 2].map((axis) =>
        points_mm.reduce(
            ([low, high], point) => [Math.min(low, point[axis]), Math.max(high, point[axis])],
            [Infinity, -Infinity],
        ),
    );
}

// The sides beside or below each other, whichever shows more: { name, axes, box, scale, at(point_mm) }.
export function sidesIn(width, height, limits) {
    const boxes = [
        [0, 1].map((i) => ({
            left: GAP + (i * (width - GAP)) / 2,
            top: 2,
            width: (width - 3 * GAP) / 2,
            height: height - GAP - 2,
        })),
        [0, 1].map((i) => ({
            left: GAP,
            top: 2 + (i * (height - 2)) / 2,
            width: width - 2 * GAP,
            height: (height - 2 * GAP) / 2,
        })),
    ];
    const extent = limits.map(([low, high]) => Math.max(LEAST_MM, high - low) * MARGIN);
    const room = ({ height }) => Math.max(1, height - ABOVE - BELOW);
    const scaleIn = (pair) =>
        Math.min(...pair.map((box, i) => Math.min(box.width / extent[SIDES[i].axes[0]], room(box) / extent[SIDES[i].axes[1]])));
    const best = scaleIn(boxes[0]) >= scaleIn(boxes[1]) ? boxes[0] : boxes[1];
    const scale = scaleIn(best);
    return SIDES.map((side, i) => {
        const [across, up] = side.axes;
        const middle = side.axes.map((axis) => (limits[axis][0] + limits[axis][1]) / 2);
        const box = best[i];
        const at = (point) => [
            box.left + box.width / 2 + (point[across] - middle[0]) * scale,
            box.top + ABOVE + room(box) / 2 - (point[up] - middle[1]) * scale,
        ];
        return { ...side, box, scale, at };
    });
}

// What is around a point, larger, in a corner of a side; null where the side itself is as large.
export function closeUp(side, point) {
    const { box, axes } = side;
    const size = Math.min(CLOSE_PARTS[0] * box.width, CLOSE_PARTS[1] * box.height);
    const scale = size / CLOSE_MM;
    if (scale < 2 * side.scale) return null;
    const close = { left: box.left + box.width - size - 3, top: box.top + 3, width: size, height: size };
    const [across, up] = axes;
    const at = (other) => [
        close.left + size / 2 + (other[across] - point[across]) * scale,
        close.top + size / 2 - (other[up] - point[up]) * scale,
    ];
    return { ...side, box: close, scale, at, times: scale / side.scale };
}

// The corners of the head of an arrow that ends at (x, y); none for one that is seen from its end.
export function arrowHead(x, y, dx, dy) {
    const length = Math.hypot(dx, dy);
    if (length < 3) return [];
    const [ux, uy] = [dx / length, dy / length];
    const at = (back, side) => [x - back * ux - side * uy, y - back * uy + side * ux];
    return [at(-5, 0), at(4, 4.5), at(4, -4.5)];
}
