#include "pipeline/program/known_networks.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>

#include "kernels/base/error.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/files/text.h"
#include "pipeline/program/convert_pca_kd.h"
#include "pipeline/program/fetch_file.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

// The commit that published them; nothing in this folder has changed since.
constexpr char kPcaKd[] =
    "https://raw.githubusercontent.com/chiutaiyin/PCA-Knowledge-Distillation/"
    "2651cd161f79bae32afdac8a52f7539043108c6b/MobileNet%20backbone/ckpts/";

constexpr char kPcaKdLicence[] =
    "PCA-KD: github.com/chiutaiyin/PCA-Knowledge-Distillation (Chiu and Gurari 2022).\n"
    "The ONNX files in this folder were converted from the authors' checkpoints.\n\n"
    "MIT License\n\n"
    "Copyright (c) 2022 chiutaiyin\n\n"
    "Permission is hereby granted, free of charge, to any person obtaining a copy\n"
    "of this software and associated documentation files (the \"Software\"), to deal\n"
    "in the Software without restriction, including without limitation the rights\n"
    "to use, copy, modify, merge, publish, distribute, sublicense, and/or sell\n"
    "copies of the Software, and to permit persons to whom the Software is\n"
    "furnished to do so, subject to the following conditions:\n\n"
    "The above copyright notice and this permission notice shall be included in all\n"
    "copies or substantial portions of the Software.\n\n"
    "THE SOFTWARE IS PROVIDED \"AS IS\", WITHOUT WARRANTY OF ANY KIND, EXPRESS OR\n"
    "IMPLIED, INCLUDING BUT NOT LIMITED TO THE WARRANTIES OF MERCHANTABILITY,\n"
    "FITNESS FOR A PARTICULAR PURPOSE AND NONINFRINGEMENT. IN NO EVENT SHALL THE\n"
    "AUTHORS OR COPYRIGHT HOLDERS BE LIABLE FOR ANY CLAIM, DAMAGES OR OTHER\n"
    "LIABILITY, WHETHER IN AN ACTION OF CONTRACT, TORT OR OTHERWISE, ARISING FROM,\n"
    "OUT OF OR IN CONNECTION WITH THE SOFTWARE OR THE USE OR OTHER DEALINGS IN THE\n"
    "SOFTWARE.\n";

PublishedFile OfPcaKd(const char* name, const char* sha256, uint64_t bytes) {
  return {name, std::string(kPcaKd) + name, sha256, bytes};
}

std::vector<std::pair<std::string, std::string>> FilesOfPcaKd(
    const std::vector<std::string>& contents, const std::string& where) {
  return ConvertPcaKd(ReadTensorBundle(contents[0], contents[1], where),
                      ReadTensorBundle(contents[2], contents[3], where), where);
}

uint64_t BytesOf(const KnownNetwork& network) {
  uint64_t sum = 0;
  for (const PublishedFile& file : network.files) sum += file.bytes;
  return sum;
}

// How a person gets the files otherwise.
std::string ByHand(const KnownNetwork& network) {
  std::string text = "put these files into " + NetworkFolder(network.name) + ":";
  for (const PublishedFile& file : network.files) text += " " + file.address;
  return text;
}

std::string Checked(const PublishedFile& file, std::string bytes, const std::string& where,
                    const KnownNetwork& network) {
  if (Sha256(bytes) != file.sha256)
    throw InputError("is not the file that was published: its SHA-256 is not " + file.sha256,
                     where, ByHand(network));
  return bytes;
}

std::string Fetched(const KnownNetwork& network, const PublishedFile& file,
                    const NetworkAccess& access) {
  try {
    return access.fetch(file.address);
  } catch (const Error& error) {
    throw InputError(error.what_failed(), error.where(), ByHand(network));
  }
}

}  // namespace

const std::vector<KnownNetwork>& KnownNetworks() {
  static const std::vector<KnownNetwork> networks = {
      {"pca-kd",
       "PCA-KD of Chiu and Gurari (2022), MIT licence",
       kPcaKdLicence,
       {OfPcaKd("sencoder.index",
                "e85c43392d569ed90e13ff3d1cb6be7751006516eeaee7ef0f140639dc67e1cd", 1981),
        OfPcaKd("sencoder.data-00000-of-00001",
                "4051956140138f9dbe15a37e45355f8aa934168d08b7faf7cfdcd554a1c46bf5", 124432),
        OfPcaKd("sdecoder.index",
                "4a8dab4cd0b966b5aa5edee47db1af71f970349e437ea86f60c824332fc9abc4", 1098),
        OfPcaKd("sdecoder.data-00000-of-00001",
                "7624fd585e5ef34264c4fc704e5725c3106349e3bf46fbd51495e6fa8e880d5a", 174158)},
       FilesOfPcaKd}};
  return networks;
}

const KnownNetwork& FindNetwork(const std::string& name) {
  std::vector<std::string> names;
  for (const KnownNetwork& network : KnownNetworks()) {
    if (network.name == name) return network;
    names.push_back(network.name);
  }
  throw UsageError("is no network that is known by name", name, "use " + Join(names, ", "));
}

std::string NetworksFolder() {
  for (const auto& [variable, below] : {std::pair{"XDG_DATA_HOME", "/regrade/networks"},
                                        std::pair{"HOME", "/.local/share/regrade/networks"}})
    if (const char* root = std::getenv(variable); root != nullptr && root[0] == '/')
      return std::string(root) + below;
  throw ResourceError("there is no folder for a user's data", "HOME and XDG_DATA_HOME",
                      "set one of them to an absolute path");
}

std::string NetworkFolder(const std::string& name) { return NetworksFolder() + "/" + name; }

bool HasNetwork(const KnownNetwork& network) {
  std::error_code error;
  return fs::is_regular_file(NetworkFolder(network.name) + "/encoder.onnx", error);
}

std::string EnsureNetwork(const KnownNetwork& network, const NetworkAccess& access) {
  const std::string folder = NetworkFolder(network.name);
  if (HasNetwork(network)) return folder;
  const auto path = [&](const PublishedFile& file) { return folder + "/" + file.name; };
  const auto lies_there = [&](const PublishedFile& file) {
    std::error_code error;
    return fs::is_regular_file(path(file), error);
  };
  const bool whole = std::ranges::all_of(network.files, lies_there);
  if (!whole) {
    const std::string offer =
        Format("--method %s needs %s: %.0f kB, fetched once from ", network.name.c_str(),
               network.summary.c_str(), static_cast<double>(BytesOf(network)) / 1000) +
        network.files[0].address.substr(0, network.files[0].address.rfind('/') + 1) +
        " and kept in " + folder;
    if (!access.ask)
      throw InputError(offer, network.name, "start again with --yes, or " + ByHand(network));
    if (!access.ask(offer))
      throw InputError("was not fetched", network.name,
                       "choose another method, or " + ByHand(network));
  }
  std::vector<std::string> contents;
  for (const PublishedFile& file : network.files)
    contents.push_back(
        whole ? Checked(file, ReadWholeFile(path(file), file.bytes), path(file), network)
              : Checked(file, Fetched(network, file, access), file.address, network));
  std::vector<std::pair<std::string, std::string>> made = network.convert(contents, folder);
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw ResourceError(error.message(), folder);
  WriteFileAtomically(folder + "/LICENSE", network.licence);
  for (size_t i = 0; i < contents.size(); ++i)
    if (!whole) WriteFileAtomically(path(network.files[i]), contents[i]);
  std::ranges::reverse(made);
  for (const auto& [name, bytes] : made) WriteFileAtomically(folder + "/" + name, bytes);
  return folder;
}

bool RemoveNetwork(const KnownNetwork& network) {
  std::error_code error;
  const uintmax_t removed = fs::remove_all(NetworkFolder(network.name), error);
  if (error) throw ResourceError(error.message(), NetworkFolder(network.name));
  return removed > 0;
}

}  // namespace regrade
