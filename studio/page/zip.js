const CRC = Uint32Array.from({ length: 256 }, (_, byte) => {
    let crc = byte;
    for (let bit = 0; bit < 8; bit++) crc = crc & 1 ? (crc >>> 1) ^ 0xedb88320 : crc >>> 1;
    return crc;
});

const crcOf = (bytes) => ~bytes.reduce((crc, byte) => CRC[(crc ^ byte) & 255] ^ (crc >>> 8), -1) >>> 0;

// Files as an archive without compression (APPNOTE 4.3: local headers, central directory, its end).
export function zip(files) {
    const parts = [];
    const directory = [];
    let at = 0;
    for (const { path, bytes } of files) {
        const name = new TextEncoder().encode(path);
        // Version 2.0, names in UTF-8, stored, 1980-01-01.
        const common = [u16(20), u16(0x0800), u16(0), u16(0), u16(0x21), u32(crcOf(bytes)), u32(bytes.length), u32(bytes.length)];
        const header = [u32(0x04034b50), ...common, u16(name.length), u16(0), name];
        directory.push(u32(0x02014b50), u16(20), ...common, u16(name.length), u16(0), u16(0), u16(0), u16(0), u32(0), u32(at), name);
        parts.push(...header, bytes);
        at += lengthOf(header) + bytes.length;
    }
    const length = lengthOf(directory);
    const end = [u32(0x06054b50), u16(0), u16(0), u16(files.length), u16(files.length), u32(length), u32(at), u16(0)];
    return new Blob([...parts, ...directory, ...end], { type: "application/zip" });
}

const u16 = (value) => Uint8Array.of(value & 255, (value >> 8) & 255);
const u32 = (value) => Uint8Array.of(value & 255, (value >> 8) & 255, (value >> 16) & 255, value >>> 24);
const lengthOf = (parts) => parts.reduce((sum, { length }) => sum + length, 0);
