// Styles one picture by the networks of a folder, numbers in and out as they are: what
// scripts/convert_networks.py --check holds against its own forward.
#include <cstdint>
#include <exception>
#include <fstream>
#include <iostream>
#include <stdexcept>
#include <string>

#include "stylize/image/onnx_stylizer.h"

namespace {

constexpr char kHelp[] =
    "style_picture DIR MAX_SIDE PHOTO STYLE OUT\n\n"
    "Pictures are two 32-bit numbers, width and height, then R, G, B as 32-bit floats, row by\n"
    "row, in the machine's own byte order.\n";

regrade::Image Read(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  int32_t sides[2] = {};
  file.read(reinterpret_cast<char*>(sides), sizeof(sides));
  if (!file || sides[0] < 1 || sides[1] < 1 || sides[0] > 8192 || sides[1] > 8192)
    throw std::runtime_error(path + " is no such picture");
  regrade::Image image(sides[0], sides[1]);
  file.read(reinterpret_cast<char*>(image.pixels.data()),
            static_cast<std::streamsize>(image.pixels.size() * sizeof(float)));
  if (!file) throw std::runtime_error(path + " ends too early");
  return image;
}

void Write(const std::string& path, const regrade::Image& image) {
  std::ofstream file(path, std::ios::binary);
  const int32_t sides[2] = {image.width, image.height};
  file.write(reinterpret_cast<const char*>(sides), sizeof(sides));
  file.write(reinterpret_cast<const char*>(image.pixels.data()),
             static_cast<std::streamsize>(image.pixels.size() * sizeof(float)));
  if (!file.flush()) throw std::runtime_error(path + " cannot be written");
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 6) {
    const bool asked = argc == 2 && std::string(argv[1]) == "--help";
    (asked ? std::cout : std::cerr) << kHelp;
    return asked ? 0 : 2;
  }
  try {
    const auto stylizer = regrade::MakeOnnxStylizer(argv[1], std::stoi(argv[2]), Read(argv[4]));
    Write(argv[5], stylizer->Stylize(Read(argv[3]), 0));
    std::cout << stylizer->Name() << "\n";
  } catch (const std::exception& exception) {
    std::cerr << exception.what() << "\n";
    return 1;
  }
  return 0;
}
