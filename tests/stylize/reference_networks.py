#!/usr/bin/env python3
"""WCT2, CCPL and CAP-VSTNet in PyTorch in double, written from the papers and facts of the published files: the reference of convert_networks.py --check.

Not a program: see `convert_networks.py --help`. It shares no code with the conversion.
"""

import os
import struct
import subprocess
import sys
import tempfile

import numpy
import torch
from torch.nn import functional

# Layers of the published files: (name, channels in, channels out, side of the kernel).
VGG = [("0", 3, 3, 1), ("2", 3, 64, 3), ("5", 64, 64, 3), ("9", 64, 128, 3), ("12", 128, 128, 3), ("16", 128, 256, 3),
       ("19", 256, 256, 3), ("22", 256, 256, 3), ("25", 256, 256, 3), ("29", 256, 512, 3)]
WAVE_NAMES = ("conv0", "conv1_1", "conv1_2", "conv2_1", "conv2_2", "conv3_1", "conv3_2", "conv3_3", "conv3_4",
              "conv4_1")
DECODER = [(1, 512, 256, 3), (5, 256, 256, 3), (8, 256, 256, 3), (11, 256, 256, 3), (14, 256, 128, 3),
           (18, 128, 128, 3), (21, 128, 64, 3), (25, 64, 64, 3), (28, 64, 3, 3)]

# Signs of a block's four pixels in a Haar wavelet's low, LH, HL and HH part.
SIGNS = ((1, 1, 1, 1), (-1, 1, -1, 1), (-1, -1, 1, 1), (1, -1, -1, 1))


def layers_of(version):
    """{file: layers} of a version."""
    if version in ("cat5", "sum"):
        many, two = (5, "_2") if version == "cat5" else (1, "")
        encoder = [(name, *layer[1:]) for name, layer in zip(WAVE_NAMES, VGG)]
        decoder = [("conv4_1", 512, 256, 3), ("conv3_4" + two, 256 * many, 256, 3), ("conv3_3", 256, 256, 3),
                   ("conv3_2", 256, 256, 3), ("conv3_1", 256, 128, 3), ("conv2_2" + two, 128 * many, 128, 3),
                   ("conv2_1", 128, 64, 3), ("conv1_2" + two, 64 * many, 64, 3), ("conv1_1", 64, 3, 3)]
        return {"encoder": encoder, "decoder": decoder}
    if version == "photo":
        sct = [("cnet.0", 256, 128, 1), ("cnet.2", 128, 32, 1), ("snet.0", 256, 128, 3), ("snet.2", 128, 32, 1),
               ("uncompress", 32, 256, 1)]
        decoder = [(str(number - 10), *rest) for number, *rest in DECODER if number > 10]
    else:
        sct = [("cnet.0", 512, 256, 1), ("cnet.2", 256, 128, 1), ("cnet.4", 128, 32, 1), ("snet.0", 512, 256, 3),
               ("snet.2", 256, 128, 3), ("snet.4", 128, 32, 1), ("uncompress", 32, 512, 1)]
        decoder = [(str(number), *rest) for number, *rest in DECODER]
    return {"vgg": VGG, "sct": sct, "decoder": decoder}


def write_random_reversible(seed, paths):
    """Blocks that change the streams a little, so that thirty-two of them stay invertible in single precision."""
    random, tensors = torch.Generator().manual_seed(seed), {}

    def block(name, inputs, width):
        for number, before, after in (("1", inputs, width // 4), ("4", width // 4, width // 4), ("7", width // 4, width)):
            gain = (2 / (9 * before)) ** 0.5 * (0.3 if number == "7" else 1)
            tensors[f"{name}.conv.{number}.weight"] = torch.randn(after, before, 3, 3, generator=random) * gain
            tensors[f"{name}.conv.{number}.bias"] = torch.randn(after, generator=random) * 0.02
    for i in range(30):
        width = (16, 64, 256)[i // 10]
        block(f"stack.{i}", width // 4 if i in (10, 20) else width, width)
    for i in range(2):
        block(f"channel_reduction.block_list.{i}", 256, 256)
    torch.save({"state_dict": tensors}, paths["model"])


def write_random(method, seed, version, paths):
    """Writes weights that preserve magnitudes: features of some tens, pictures around middle grey."""
    if method == "capvst":
        return write_random_reversible(seed, paths)
    random = torch.Generator().manual_seed(seed)
    for file, layers in layers_of(version).items():
        tensors = {}
        for name, inputs, outputs, side in layers:
            spread = (2 / (inputs * side * side)) ** 0.5
            first, last = name in ("0", "conv0"), file == "decoder" and outputs == 3
            factor = 20 if first and file != "decoder" else 1
            if last:
                factor = 0.04 if version in ("cat5", "sum") else 0.007
            elif name == "uncompress":
                factor = 0.2
            tensors[f"{name}.weight"] = torch.randn(outputs, inputs, side, side, generator=random) * spread * factor
            tensors[f"{name}.bias"] = torch.randn(outputs, generator=random) * 0.05 + (0.5 if last else 0)
        if version in ("cat5", "sum"):  # the published files contain the fixed wavelets
            for level, count in enumerate((64, 128, 256), 1):
                name = f"pool{level}" if file == "encoder" else f"recon_block{level}"
                for part, signs in zip(("LL", "LH", "HL", "HH"), SIGNS):
                    tensors[f"{name}.{part}.weight"] = torch.tensor(signs).reshape(2, 2).repeat(count, 1, 1, 1) / 2
        # In torch's older format, as WCT2's files, which are older than torch 1.6.
        torch.save(tensors, paths[file], _use_new_zipfile_serialization=False)


class Layers:
    def __init__(self, tensors):
        self.tensors = {key: value.double() for key, value in tensors.items()}

    def has(self, name):
        return f"{name}.weight" in self.tensors

    def __call__(self, x, *names, pad=True, relu=True):
        for name in names:
            if pad:
                x = functional.pad(x, (1, 1, 1, 1), mode="reflect")
            x = functional.conv2d(x, self.tensors[f"{name}.weight"], self.tensors[f"{name}.bias"])
            x = x.clamp(min=0) if relu else x
        return x


def haar(x):
    """The four half-size bands of a picture: sums and differences of its 2 x 2 blocks."""
    a, b, c, d = x[..., ::2, ::2], x[..., ::2, 1::2], x[..., 1::2, ::2], x[..., 1::2, 1::2]
    return (a + b + c + d) / 2, (b - a + d - c) / 2, (c - a + d - b) / 2, (a - b - c + d) / 2


def inverse_haar(part, signs):
    """The contribution of one band to the picture: its value at each pixel of the block, with a sign."""
    whole = part.new_zeros(*part.shape[:2], 2 * part.shape[2], 2 * part.shape[3])
    for i, sign in enumerate(signs):
        whole[..., i // 2::2, i % 2::2] = sign * part / 2
    return whole


def root(features, exponent):
    """(C + 1)^exponent and the mean; WCT2 divides by n - 1 and adds the unit matrix."""
    rows = features.flatten(2)[0]
    mean = rows.mean(1, keepdim=True)
    covariance = (rows - mean) @ (rows - mean).T / (rows.shape[1] - 1) + torch.eye(len(rows), dtype=torch.float64)
    values, vectors = torch.linalg.eigh(covariance)
    return vectors @ torch.diag(values ** exponent) @ vectors.T, mean


def whitened_and_colored(content, style):
    whiten, mean = root(content, -0.5)
    color, target = root(style, 0.5)
    rows = color @ whiten @ (content.flatten(2)[0] - mean) + target
    return rows.clamp(content.min(), content.max()).reshape(content.shape)


def wct2(states, photo, style, transform, version):
    encode, decode = Layers(states["encoder"]), Layers(states["decoder"])
    cat5 = decode.has("conv3_4_2")

    def run(x, at):
        over = {}

        def pool(x, level):
            low, *bands = haar(x)
            over[level] = (bands, x)
            return low

        def unpool(x, level):
            bands, whole = over[level]
            parts = [inverse_haar(part, signs) for part, signs in zip([x, *bands], SIGNS)]
            return torch.cat([*parts, whole], 1) if cat5 else sum(parts)
        x = encode(encode(x, "conv0", pad=False, relu=False), "conv1_1")
        if cat5:
            x = at("e1", x)
            x = at("e2", encode(pool(encode(x, "conv1_2"), 1), "conv2_1"))
            x = at("e3", encode(pool(encode(x, "conv2_2"), 2), "conv3_1"))
            x = at("e4", encode(pool(encode(x, "conv3_2", "conv3_3", "conv3_4"), 3), "conv4_1"))
        else:
            x = at("e1", pool(encode(x, "conv1_2"), 1))
            x = at("e2", pool(encode(x, "conv2_1", "conv2_2"), 2))
            x = at("e3", pool(encode(x, "conv3_1", "conv3_2", "conv3_3", "conv3_4"), 3))
            x = at("e4", encode(x, "conv4_1"))
        for level, (bands, whole) in over.items():
            over[level] = ([at(f"s{level}{i}", band) for i, band in enumerate(bands)], whole)
        two = "_2" if cat5 else ""
        x = decode(unpool(decode(x, "conv4_1"), 3), "conv3_4" + two, "conv3_3", "conv3_2")
        x = at("d3", x) if cat5 else x
        x = decode(unpool(decode(x, "conv3_1"), 2), "conv2_2" + two)
        x = at("d2", x) if cat5 else x
        x = decode(unpool(decode(x, "conv2_1"), 1), "conv1_2" + two)
        x = at("d1", x) if cat5 else x
        return decode(x, "conv1_1", relu=False)
    seen = {}
    run(style, lambda place, x: seen.setdefault(place, x))
    height, width = photo.shape[2:]
    photo = functional.pad(photo, (0, -width % 8, 0, -height % 8), mode="reflect")
    styled = run(photo, lambda place, x: whitened_and_colored(x, seen[place]) if transform else x)
    return styled[..., :height, :width]


def ccpl(states, photo, style, transform, version):
    vgg, sct, decode = (Layers(states[name]) for name in ("vgg", "sct", "decoder"))
    artistic = sct.has("cnet.4")

    def pool(x):
        return functional.max_pool2d(x, 2, ceil_mode=True)

    def encode(x):
        x = pool(vgg(vgg(x, "0", pad=False, relu=False), "2", "5"))
        x = vgg(pool(vgg(x, "9", "12")), "16")
        return vgg(pool(vgg(x, "19", "22", "25")), "29") if artistic else x

    def code(net, x):
        x = sct(x, *([f"{net}.0", f"{net}.2"] if artistic else [f"{net}.0"]), pad=False)
        return sct(x, f"{net}.4" if artistic else f"{net}.2", pad=False, relu=False)

    def doubled(x):
        return x.repeat_interleave(2, 2).repeat_interleave(2, 3)
    content, styles = encode(photo), encode(style)
    mean = styles.mean((2, 3), keepdim=True)
    x = content
    if transform:
        normal = (content - content.mean((2, 3), keepdim=True)) / (content.var((2, 3), keepdim=True) + 1e-5).sqrt()
        rows = code("snet", styles - mean).flatten(2)[0]
        narrow = code("cnet", normal)
        narrow = (rows @ rows.T / rows.shape[1] @ narrow.flatten(2)[0]).reshape(narrow.shape)
        x = sct(narrow, "uncompress", pad=False, relu=False) + mean
    first = 10 if not artistic and not decode.has("28") else 0

    def layer(x, *numbers, relu=True):
        return decode(x, *(str(number - first) for number in numbers), relu=relu)
    x = layer(doubled(layer(x, 1)), 5, 8) if artistic else x
    x = layer(doubled(layer(x, 11, 14)), 18, 21)
    x = layer(layer(doubled(x), 25), 28, relu=False)
    return x[..., :photo.shape[2], :photo.shape[3]]


def capvst(states, photo, style, transform, version):
    tensors = {key: value.double() for key, value in states["model"].items()}
    names = [f"stack.{i}" for i in range(30)] + [f"channel_reduction.block_list.{i}" for i in range(2)]

    def change(name, x):
        stride = 2 if name in ("stack.10", "stack.20") else 1
        for number in ("1", "4", "7"):
            x = functional.conv2d(functional.pad(x, (1, 1, 1, 1), mode="reflect"), tensors[f"{name}.conv.{number}.weight"],
                                  tensors[f"{name}.conv.{number}.bias"], stride=stride if number == "1" else 1)
            x = x.clamp(min=0) if number != "7" else x
        return x

    def gathered(x):  # the pixels of a block, one after the other
        return torch.cat([x[..., i::2, j::2] for i in (0, 1) for j in (0, 1)], 1)

    def scattered(x):
        part = x.shape[1] // 4
        whole = x.new_zeros(x.shape[0], part, 2 * x.shape[2], 2 * x.shape[3])
        for k in range(4):
            whole[..., k // 2::2, k % 2::2] = x[:, k * part:(k + 1) * part]
        return whole

    def encode(x):
        old = torch.cat([x, x.new_zeros(1, 13, *x.shape[2:])], 1)
        new = torch.zeros_like(old)
        for name in names:
            changed = change(name, new)
            if changed.shape[2] != new.shape[2]:
                old, new = gathered(old), gathered(new)
            old, new = new, old + changed
        x = torch.cat([old, new], 1)
        return scattered(x) if version == "art" else scattered(scattered(x))

    def decode(x):
        x = gathered(x) if version == "art" else gathered(gathered(x))
        old, new = x[:, :256], x[:, 256:]
        for name in reversed(names):
            half = name in ("stack.10", "stack.20")
            before = scattered(old) if half else old
            first = new - change(name, before)
            old, new = scattered(first) if half else first, before
        return old[:, :3]

    def moments(x):
        rows = x.flatten(2)[0]
        mean = rows.mean(1, keepdim=True)
        return rows - mean, mean, torch.linalg.cholesky((rows - mean) @ (rows - mean).T / (rows.shape[1] - 1))
    height, width = photo.shape[2:]
    code = encode(functional.pad(photo, (0, -width % 4, 0, -height % 4), mode="reflect"))
    if transform:
        rows, _, lower = moments(code)
        _, mean, target = moments(encode(style))
        code = (target @ torch.linalg.solve(lower, rows) + mean).reshape(code.shape)
    return decode(code)[..., :height, :width]


def picture(height, width, tint, seed):
    """Soft waves, an edge and grain, in [0, 1]: [1, 3, height, width]."""
    y, x = numpy.mgrid[:height, :width]
    grain = numpy.random.default_rng(seed).random((3, height, width)) - 0.5
    channels = [t * (0.5 + 0.25 * numpy.sin(0.11 * x + c) + 0.2 * numpy.cos(0.07 * y - c) + 0.15 * (x + y > width))
              for c, t in enumerate(tint)]
    return torch.from_numpy(numpy.clip(numpy.array(channels) + 0.06 * grain, 0, 1).astype("float32"))[None]


def write_picture(path, values):
    with open(path, "wb") as file:
        file.write(struct.pack("=ii", values.shape[3], values.shape[2]))
        file.write(values[0].permute(1, 2, 0).contiguous().numpy().tobytes())


def read_picture(path):
    with open(path, "rb") as file:
        width, height = struct.unpack("=ii", file.read(8))
        values = numpy.frombuffer(file.read(), "float32").reshape(height, width, 3)
    return torch.from_numpy(values.copy()).permute(2, 0, 1)[None].double()


def check(method, version, states, folder, program):
    """Returns 0 if the program's pictures agree with this implementation to 1e-4 of white, otherwise 1."""
    forward = {"wct2": wct2, "ccpl": ccpl, "capvst": capvst}[method]
    style = picture(64, 96, (1.0, 0.6, 0.35), 2)
    worst = 0.0
    with tempfile.TemporaryDirectory() as scratch, torch.no_grad():
        paths = [os.path.join(scratch, name) for name in ("photo", "style", "out")]
        write_picture(paths[1], style)
        for height, width in ((72, 104), (61, 83)):
            photo = picture(height, width, (0.8, 0.9, 1.0), 1)
            write_picture(paths[0], photo)
            subprocess.run([program, folder, "1024", *paths], check=True, stdout=subprocess.DEVNULL)
            got = read_picture(paths[2])
            expected = forward(states, photo.double(), style.double(), True, version)
            without = forward(states, photo.double(), style.double(), False, version).clamp(0, 1)
            inside = ((expected > 0) & (expected < 1)).double().mean()
            difference = (got - expected.clamp(0, 1)).abs().max()
            worst = max(worst, difference.item())
            print(f"{method} {width} x {height}: largest difference {difference:.2e} of pictures from "
                  f"{expected.min():.3f} to {expected.max():.3f}, spread {expected.std():.3f} ({100 * inside:.1f} % "
                  f"not clipped); without transforms {(without - expected.clamp(0, 1)).abs().max():.2e}")
    return 0 if worst <= 1e-4 else 1


if __name__ == "__main__":
    print(__doc__)
    sys.exit(0 if sys.argv[1:] == ["--help"] else 2)
