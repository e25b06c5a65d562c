"""What happens to pixel data on its way. Each takes bytes and a random generator, and gives bytes."""


def part(rng, size, least=0.05, most=0.95):
    return int(size * rng.uniform(least, most))


def truncated(data, rng):
    return data[:part(rng, len(data)) // 2 * 2]


def zeroed(data, rng):
    kept = part(rng, len(data))
    return data[:kept] + bytes(len(data) - kept)


def zeroed_stretch(data, rng):
    first = part(rng, len(data))
    size = min(int(rng.integers(64, 4096)), len(data) - first)
    return data[:first] + bytes(size) + data[first + size:]


def flipped(data, rng):
    changed = bytearray(data)
    for at in rng.integers(len(data) // 50, len(data), int(rng.integers(1, 9))):
        changed[at] ^= int(rng.integers(1, 256))
    return bytes(changed)


def burst(data, rng):
    first = part(rng, len(data))
    size = min(int(rng.integers(16, 512)), len(data) - first)
    return data[:first] + rng.bytes(size) + data[first + size:]


def lost_bytes(data, rng):
    """A part is missing, what follows moves up."""
    first = part(rng, len(data))
    size = int(rng.integers(1, 2048))
    return data[:first] + data[first + size:]


def lost_and_filled(data, rng):
    harmed = lost_bytes(data, rng)
    return harmed + bytes(len(data) - len(harmed))


def swapped_bytes(data, rng):
    """High and low bytes exchanged from a place on."""
    first = part(rng, len(data)) // 2 * 2
    tail = bytearray(data[first:])
    tail[0::2], tail[1::2] = tail[1::2], tail[0::2]
    return data[:first] + bytes(tail)


def quarters(data):
    step = (len(data) // 4 + 1) // 2 * 2
    return [data[:step], data[step:2 * step], data[2 * step:3 * step], data[3 * step:]]


def lost_fragment(data, rng):
    parts = quarters(data)
    del parts[int(rng.integers(1, 4))]
    return b''.join(parts)


def swapped_fragments(data, rng):
    parts = quarters(data)
    a, b = rng.choice([1, 2, 3], 2, replace=False)
    parts[a], parts[b] = parts[b], parts[a]
    return b''.join(parts)


NATIVE = [truncated, zeroed, zeroed_stretch, flipped, burst, lost_bytes, lost_and_filled, swapped_bytes, swapped_fragments]
COMPRESSED = [truncated, zeroed, zeroed_stretch, flipped, burst, lost_bytes, lost_fragment, swapped_fragments]
# Harms of the deflated stream itself, besides those of the pixels in it.
STREAM = [truncated, zeroed, flipped, burst, lost_bytes]
# Between slices.
EXCHANGED, REPEATED = 'exchanged with another slice', 'another slice in its place'
