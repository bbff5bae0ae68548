#!/usr/bin/env python3
"""Converts published PyTorch weights of WCT2, CCPL or CAP-VSTNet to the ONNX files that `--method onnx:DIR` reads.

  convert_networks.py wct2 --encoder wave_encoder_cat5_l4.pth --decoder wave_decoder_cat5_l4.pth --out DIR
  convert_networks.py ccpl --vgg vgg_normalised.pth --sct SCT.pth.tar --decoder DECODER.pth.tar --out DIR
  convert_networks.py capvst --model photo_image.pt --out DIR

Download the weights from their authors (github.com/clovaai/WCT2, github.com/JarrentWu1031/CCPL,
github.com/linfengWen98/CAP-VSTNet) and read their licences. Supported are both versions of WCT2, cat5 and sum, and the
photorealistic and artistic models of CCPL and CAP-VSTNet; the version is detected from the file, but of CAP-VSTNet, whose
two models have the same layers: name it with --version art. Needs Debian's python3-torch and python3-onnx (run it with /usr/bin/python3). Files are loaded as weights
only: no code in them is executed.

  --random SEED    first writes files with random weights of the right shapes to DIR (--version cat5, sum, photo or art),
                   and converts these
  --check PROGRAM  then styles two pictures with PROGRAM (build/cpu/tests/stylize/style_picture) and with a separate
                   PyTorch implementation (tests/stylize/reference_networks.py), and prints the largest difference, and
                   the difference without the feature transforms

Exit status: 0, or 1 if an input is wrong or --check finds a difference above 1e-4 of white.
"""

import argparse
import os
import sys

# For --random and --check.
sys.path.append(os.path.join(os.path.dirname(os.path.abspath(__file__)), "../tests/stylize"))

HAAR = {"ll": (1, 1, 1, 1), "lh": (-1, 1, -1, 1), "hl": (-1, -1, 1, 1), "hh": (1, -1, -1, 1)}  # halves, 2 x 2
BANDS = ("lh", "hl", "hh")


class Segment:
    """Builds one ONNX file: opset 11, float32, any height and width."""

    def __init__(self, **inputs):
        import onnx.numpy_helper
        self.onnx, self.nodes, self.weights, self.channels = onnx, [], {}, dict(inputs)
        self.inputs = list(inputs)

    def add(self, kind, inputs, channels, output=None, **attributes):
        name = output or f"t{len(self.nodes)}"
        self.nodes.append(self.onnx.helper.make_node(kind, inputs, [name], name=name, **attributes))
        self.channels[name] = channels
        return name

    def constant(self, values, kind="float32"):
        import numpy
        name = f"w{len(self.weights)}"
        self.weights[name] = numpy.asarray(values, kind)
        return name

    def conv(self, x, state, key, out=None, relu=True, pad=True, stride=1):
        """With `pad` reflects one pixel at each edge; then convolves without padding; with `relu` applies max(0, x)."""
        weight, bias = state.take(key)
        if weight.shape[1] != self.channels[x]:
            sys.exit(f"{state.path}: {key} takes {weight.shape[1]} channels, the input has {self.channels[x]}")
        if pad:
            edges = self.constant([0, 0, 1, 1, 0, 0, 1, 1], "int64")
            x = self.add("Pad", [x, edges], self.channels[x], mode="reflect")
        sides = list(weight.shape[2:])
        x = self.add("Conv", [x, self.constant(weight), self.constant(bias)], weight.shape[0],
                     None if relu else out, kernel_shape=sides, strides=[stride, stride])
        return self.add("Relu", [x], weight.shape[0], out) if relu else x

    def halve(self, x):
        return self.add("MaxPool", [x], self.channels[x], kernel_shape=[2, 2], strides=[2, 2], ceil_mode=1)

    def double(self, x):
        return self.add("Resize", [x, self.constant([]), self.constant([1, 1, 2, 2])], self.channels[x],
                        mode="nearest", coordinate_transformation_mode="asymmetric", nearest_mode="floor")

    def wavelet(self, kind, x, band, out=None):
        """Haar pooling ("Conv") or its transpose ("ConvTranspose"), channel by channel."""
        count = self.channels[x]
        kernel = [[[[v / 2 for v in HAAR[band][:2]], [v / 2 for v in HAAR[band][2:]]]]] * count
        return self.add(kind, [x, self.constant(kernel)], count, out, group=count, kernel_shape=[2, 2], strides=[2, 2])

    def pick(self, x, channels, out=None):
        """The channels of these numbers; zeros for numbers that x has not."""
        weight = [[[[float(i == k)]] for i in range(self.channels[x])] for k in channels]
        return self.add("Conv", [x, self.constant(weight)], len(weight), out, kernel_shape=[1, 1])

    def blocks(self, kind, x, out=None):
        """The four pixels of each block of 2 x 2 as four groups of channels ("Conv"), or back ("ConvTranspose")."""
        import numpy
        count = self.channels[x] if kind == "Conv" else self.channels[x] // 4
        weight = numpy.zeros((4 * count, count, 2, 2))
        for k in range(4):
            for c in range(count):
                weight[k * count + c, c, k // 2, k % 2] = 1
        return self.add(kind, [x, self.constant(weight)], 4 * count if kind == "Conv" else count, out,
                        kernel_shape=[2, 2], strides=[2, 2])

    def file(self, name, outputs):
        """(name, bytes)"""
        helper, to_tensor = self.onnx.helper, self.onnx.numpy_helper.from_array

        def info(tensor):
            shape = [1, self.channels[tensor], f"{tensor}_h", f"{tensor}_w"]
            return helper.make_tensor_value_info(tensor, self.onnx.TensorProto.FLOAT, shape)
        graph = helper.make_graph(self.nodes, name, [info(n) for n in self.inputs],
                                  [info(n) for n in outputs], [to_tensor(v, n) for n, v in self.weights.items()])
        model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 11)])
        model.ir_version = 6
        self.onnx.checker.check_model(model)
        return name + ".onnx", model.SerializeToString()


class State:
    """The tensors of a weights file."""

    def __init__(self, path):
        import torch
        self.path = path
        if not os.path.isfile(path):
            sys.exit(f"{path}: no such file; download it from the authors")
        try:
            self.tensors = torch.load(path, map_location="cpu", weights_only=True)
        except Exception:  # torch's own message recommends to trust the file
            sys.exit(f"{path}: torch cannot read weights from it; download it again")
        if isinstance(self.tensors, dict) and isinstance(self.tensors.get("state_dict"), dict):
            self.tensors = self.tensors["state_dict"]  # beside the state of its training
        if not isinstance(self.tensors, dict):
            sys.exit(f"{path}: does not contain a table of tensors")

    def __contains__(self, key):
        return f"{key}.weight" in self.tensors

    def take(self, key):
        parts = [self.tensors.get(f"{key}.{part}") for part in ("weight", "bias")]
        if any(part is None for part in parts):
            sys.exit(f"{self.path}: has no {key}.weight and {key}.bias; is it the file of another model?")
        return [part.float().numpy() for part in parts]


def check_haar(state):
    """Checks the wavelets in a published file, which must be Haar's."""
    import numpy
    for key, value in state.tensors.items():
        parts = key.split(".")
        if len(parts) == 3 and parts[1].lower() in HAAR:
            expected = numpy.array(HAAR[parts[1].lower()]).reshape(2, 2) / 2
            if abs(value.numpy() - expected).max() > 1e-6:
                sys.exit(f"{state.path}: {key} is not a Haar wavelet")


def wct2_files(encoder, decoder):
    """The network of Yoo et al. 2019, Fig. 3, with the layers of clovaai/WCT2, split where features are transformed."""
    for state in (encoder, decoder):
        check_haar(state)
    version = "cat5" if "conv3_4_2" in decoder else "sum"
    cat5, two = version == "cat5", "_2" if version == "cat5" else ""
    # cat5 transforms the features after the first layer of each size, sum those after each pooling.
    stages = ([["conv0", "conv1_1"], ["conv1_2", "|", "conv2_1"], ["conv2_2", "|", "conv3_1"],
               ["conv3_2", "conv3_3", "conv3_4", "|", "conv4_1"]] if cat5 else
              [["conv0", "conv1_1", "conv1_2", "|"], ["conv2_1", "conv2_2", "|"],
               ["conv3_1", "conv3_2", "conv3_3", "conv3_4", "|"], ["conv4_1"]])
    widths = (3, 64, 128, 256)
    for level, layers in enumerate(stages, 1):
        name = "image" if level == 1 else "feat"
        segment = Segment(**{name: widths[level - 1]})
        x, outputs = name, ["out"]
        for layer in layers:
            last = layer == layers[-1]
            if layer == "|":
                if cat5:
                    outputs.append("skip")
                for band in BANDS:
                    segment.wavelet("Conv", x, band, band)
                outputs += BANDS
                x = segment.wavelet("Conv", x, "ll", "out" if last else None)
            else:
                splits = cat5 and not last and layers[layers.index(layer) + 1] == "|"
                x = segment.conv(x, encoder, layer, "out" if last else "skip" if splits else None,
                                 relu=layer != "conv0", pad=layer != "conv0")
        yield segment.file(f"wct2_{version}_encoder{level}", outputs)
    blocks = {4: (["conv4_1"], ["conv3_4" + two, "conv3_3", "conv3_2"]), 3: (["conv3_1"], ["conv2_2" + two]),
              2: (["conv2_1"], ["conv1_2" + two])}
    for level, (before, after) in blocks.items():
        count = widths[level - 1]
        inputs = dict(feat=2 * count, **{band: count for band in BANDS})
        segment = Segment(**inputs, **({"skip": count} if cat5 else {}))
        x = segment.conv("feat", decoder, before[0])
        parts = [segment.wavelet("ConvTranspose", part, band) for part, band in zip([x, *BANDS], HAAR)]
        if cat5:
            x = segment.add("Concat", [*parts, "skip"], 5 * count, axis=1)
        else:
            x = parts[0]
            for part in parts[1:]:
                x = segment.add("Add", [x, part], count)
        for layer in after:
            x = segment.conv(x, decoder, layer, "out" if layer == after[-1] else None)
        yield segment.file(f"wct2_{version}_decoder{level}", ["out"])
    segment = Segment(feat=64)
    segment.conv("feat", decoder, "conv1_1", "image", relu=False)
    yield segment.file(f"wct2_{version}_decoder1", ["image"])


def ccpl_files(vgg, sct, decoder):
    """The networks of Wu et al. 2022, Fig. 3, with the layer numbers of JarrentWu1031/CCPL."""
    count = sct.take("uncompress")[0].shape[0]
    if count not in (256, 512):
        sys.exit(f"{sct.path}: {count} channels are neither the photorealistic model (256) nor the artistic one (512)")
    artistic = count == 512
    segment = Segment(image=3)
    x = segment.conv("image", vgg, "0", relu=False, pad=False)
    layers = ["2", "5", "|", "9", "12", "|", "16"] + (["19", "22", "25", "|", "29"] if artistic else [])
    for layer in layers:
        last = layer == layers[-1]
        x = segment.halve(x) if layer == "|" else segment.conv(x, vgg, layer, "feat" if last else None)
    yield segment.file("ccpl_encoder", ["feat"])
    for net, name in (("cnet", "content"), ("snet", "style")):
        segment, x = Segment(feat=count), "feat"
        numbers = (0, 2, 4) if artistic else (0, 2)
        for number in numbers:
            last = number == numbers[-1]
            x = segment.conv(x, sct, f"{net}.{number}", "code" if last else None, relu=not last, pad=False)
        yield segment.file(f"ccpl_{name}", ["code"])
    segment = Segment(code=sct.take("uncompress")[0].shape[1])
    segment.conv("code", sct, "uncompress", "feat", relu=False, pad=False)
    yield segment.file("ccpl_expand", ["feat"])
    # The photorealistic decoder is the artistic one from its tenth part on; files use either numbering.
    first = 0 if artistic or "28" in decoder else 10
    layers = [1, "|", 5, 8] if artistic else []
    layers += [11, 14, "|", 18, 21, "|", 25, 28]
    segment, x = Segment(feat=count), "feat"
    for layer in layers:
        last = layer == 28
        x = (segment.double(x) if layer == "|" else
             segment.conv(x, decoder, str(layer - first), "image" if last else None, relu=not last))
    yield segment.file("ccpl_decoder", ["image"])


class ReversibleBlock:
    """A block of CAP-VSTNet on two streams: (x1, x2) -> (x2, x1 + F(x2)), at stride 2 both at half the size."""

    def __init__(self, segment, state, name, stride):
        self.segment, self.state, self.name, self.stride = segment, state, name, stride

    def change(self, x):
        for layer in ("1", "4", "7"):
            stride = self.stride if layer == "1" else 1
            x = self.segment.conv(x, self.state, f"{self.name}.conv.{layer}", relu=layer != "7", stride=stride)
        return x

    def there(self, x1, x2):
        changed = self.change(x2)
        if self.stride == 2:
            x1, x2 = self.segment.blocks("Conv", x1), self.segment.blocks("Conv", x2)
        return x2, self.segment.add("Add", [changed, x1], self.segment.channels[x1])

    def back(self, x2, y1):
        if self.stride == 2:
            x2 = self.segment.blocks("ConvTranspose", x2)
        x1 = self.segment.add("Sub", [y1, self.change(x2)], self.segment.channels[y1])
        return self.segment.blocks("ConvTranspose", x1) if self.stride == 2 else x1, x2


def capvst_files(model, version):
    """The reversible network of Wen et al. 2023, with the layer names of linfengWen98/CAP-VSTNet, there and back."""
    hidden, spreads = (64, 1) if version == "art" else (16, 2)
    depth, widths = 10, (16, 64, 256)

    def blocks(segment):
        for i in range(len(widths) * depth):
            yield ReversibleBlock(segment, model, f"stack.{i}", 2 if i in (depth, 2 * depth) else 1)
        for i in range(2):
            yield ReversibleBlock(segment, model, f"channel_reduction.block_list.{i}", 1)
    segment = Segment(image=3)
    # The picture and zeros in two streams of 16 channels, of which the picture has the first three.
    x1, x2 = (segment.pick("image", range(first, first + widths[0])) for first in (0, 2 * widths[0]))
    for block in blocks(segment):
        x1, x2 = block.there(x1, x2)
    x = segment.add("Concat", [x1, x2], 2 * widths[2], axis=1)
    for i in range(spreads):
        x = segment.blocks("ConvTranspose", x, "code" if i + 1 == spreads else None)
    yield segment.file("capvst_encoder", ["code"])
    count = 2 * widths[2] // 4 ** spreads
    segment = Segment(code=count)
    x = "code"
    for _ in range(spreads):
        x = segment.blocks("Conv", x)
    x1, x2 = (segment.pick(x, range(first, first + widths[2])) for first in (0, widths[2]))
    for block in reversed(list(blocks(segment))):
        x1, x2 = block.back(x1, x2)
    segment.pick(x1, range(3), "image")
    yield segment.file("capvst_decoder", ["image"])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("method", choices=["wct2", "ccpl", "capvst"])
    for name, text in (("encoder", "WCT2's encoder"), ("decoder", "WCT2's or CCPL's decoder"),
                       ("vgg", "CCPL's VGG-19"), ("sct", "CCPL's SCT module"), ("model", "CAP-VSTNet's network")):
        parser.add_argument(f"--{name}", metavar="FILE", help=text)
    parser.add_argument("--out", metavar="DIR", required=True, help="folder for the ONNX files, created if missing")
    parser.add_argument("--random", metavar="SEED", type=int, help="convert random weights, see above")
    parser.add_argument("--version", choices=["cat5", "sum", "photo", "art"], help="which model --random makes, and of CAP-VSTNet which the file is (photo)")
    parser.add_argument("--check", metavar="PROGRAM", help="compare with a PyTorch forward, see above")
    options = parser.parse_args()
    try:
        import onnx  # noqa: F401
        import torch  # noqa: F401
    except ImportError as error:
        sys.exit(f"{error}: install Debian's python3-torch and python3-onnx, and run this with /usr/bin/python3")
    os.makedirs(options.out, exist_ok=True)
    versions = {"wct2": ("cat5", "sum")}.get(options.method, ("photo", "art"))
    version = options.version or versions[0]
    if version not in versions:
        parser.error(f"{options.method} has no version {version}")
    names = {"wct2": ("encoder", "decoder"), "ccpl": ("vgg", "sct", "decoder"), "capvst": ("model",)}[options.method]
    paths = {name: getattr(options, name) for name in names}
    if options.random is not None:
        import reference_networks
        paths = {name: f"{options.out}/random_{name}.pth" for name in names}
        reference_networks.write_random(options.method, options.random, version, paths)
    missing = [name for name in names if not paths[name]]
    if missing:
        parser.error(options.method + " also needs " + ", ".join(f"--{name}" for name in missing))
    states = {name: State(path) for name, path in paths.items()}
    convert = {"wct2": wct2_files, "ccpl": ccpl_files,
               "capvst": lambda model: capvst_files(model, version)}[options.method]
    files = list(convert(**states))  # all, before any is written
    for name, content in files:
        with open(os.path.join(options.out, name), "wb") as file:
            file.write(content)
        print(os.path.join(options.out, name))
    if options.check:
        import reference_networks
        tensors = {name: state.tensors for name, state in states.items()}
        sys.exit(reference_networks.check(options.method, version, tensors, options.out, options.check))


if __name__ == "__main__":
    main()
