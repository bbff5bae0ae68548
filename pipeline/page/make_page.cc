#include "pipeline/page/make_page.h"

#include <algorithm>
#include <filesystem>
#include <future>
#include <optional>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/image/color_statistics.h"
#include "kernels/image/resize.h"
#include "kernels/render/field_renderer.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/fields/object_file.h"
#include "pipeline/fields/residual_file.h"
#include "pipeline/fields/seen_field.h"
#include "pipeline/files/text.h"
#include "pipeline/images/image_file.h"
#include "pipeline/page/check_page.h"
#include "pipeline/page/color_code.h"
#include "pipeline/page/keyframes.h"
#include "pipeline/page/most_shown.h"
#include "pipeline/page/page_file.h"
#include "pipeline/run/run_file.h"
#include "pipeline/workspace/style_folders.h"
#include "stylize/field/apply_network.h"
#include "stylize/field/blend_fields.h"

namespace regrade {
namespace {

constexpr int kMostPhotos = 24, kThumbnail = 128, kPoster = 480, kChecked = 320;  // pixels
constexpr int kQuality = 75;

std::string Thumbnail(const Image& image, int longest) {
  const double scale = std::min(1.0, double{1} * longest / std::max(image.width, image.height));
  return EncodeJpeg(Resize(image, std::max(1, static_cast<int>(image.width * scale)),
                           std::max(1, static_cast<int>(image.height * scale))),
                    kQuality);
}

// What the style of a folder adds to the field splat by splat, in the field's order.
StyleLayers ReadLayers(const std::string& style_folder, const KeptRecords& records) {
  StyleLayers layers;
  if (const std::string file = style_folder + "/residual.npz"; std::filesystem::exists(file))
    layers.residual = ReadResidualFile(file, records);
  if (const std::string file = style_folder + "/object.npz"; std::filesystem::exists(file))
    layers.weight = ReadObjectFile(file, records).all;
  return layers;
}

template <typename T>
std::vector<T> Chosen(const std::vector<T>& values, const std::vector<int64_t>& of) {
  std::vector<T> chosen;
  for (size_t i = 0; i < of.size() && !values.empty(); ++i)
    chosen.push_back(values[static_cast<size_t>(of[i])]);
  return chosen;
}

StyleLayers InPageOrder(const StyleLayers& layers, const std::vector<int64_t>& of) {
  return {{Chosen(layers.residual.color, of), Chosen(layers.residual.view_scale, of)},
          Chosen(layers.weight, of)};
}

// The styled field without any rounding.
RadianceField ExactStyle(const RadianceField& source, const StoredNetwork& network,
                         const StyleLayers& layers) {
  RadianceField exact{source.geometry, ApplyNetwork(network.network, source),
                      network.background, source.near_clip, source.march};
  if (!layers.residual.color.empty()) AddResidual(layers.residual, &exact.appearance);
  return layers.weight.empty() ? exact : MixFields(source, {&exact}, {1}, &layers.weight);
}

Image RenderHome(const RadianceField& field, const Camera& home) {
  return FieldRenderer(field, Backend::kCpu).Render(SmallerView(home, kPoster)).color;
}

void AddPhotos(const WorkingViews& views, bool named, PageContent* content) {
  std::vector<ColorStatistics> parts;
  const int count = std::min(views.count(), kMostPhotos);
  for (int i = 0; i < count; ++i) {
    const int chosen = i * views.count() / count;
    content->cameras.push_back(views.CameraOf(chosen).Undistorted());
    const Image photo = views.Photo(chosen);
    content->photos.push_back({i, Thumbnail(photo, kThumbnail),
                               named ? Printable(views.View(chosen).file) : std::string()});
    parts.push_back(MeasureColor(photo));
  }
  content->colors = Pool(parts);
  content->home = HomeCamera(content->cameras);
}

const Camera& HomeOf(const PageContent& content) {
  return content.cameras[static_cast<size_t>(content.home)];
}

// The field, and beside it the photos.
void EncodeScene(const RadianceField& field, const WorkingViews& views, bool named,
                 PageContent* content) {
  std::future<void> beside =
      std::async(std::launch::async, [&] { AddPhotos(views, named, content); });
  content->field = EncodeField(field);
  beside.get();
}

// Bytes in base64.
int64_t InText(size_t bytes) { return static_cast<int64_t>((bytes + 2) / 3 * 4); }

std::string CheckLine(const std::string& what, const PageCheck& check) {
  return what + Format(" to the exact one, worst of %d views: %.1f dB (mean %.1f)", check.views,
                       check.worst_db, check.mean_db);
}

// A style of the page `made`, with what it adds to the exact `source` splat by splat. It is
// compared with the exact style in the views `checked`; the source's colours are read only
// then.
void AddStyle(const std::string& style_folder, const std::string& name,
              const StoredField& stored, const std::vector<Camera>& checked,
              PageContent* content, MadePage* made) {
  const StoredNetwork network = ReadNetworkFile(style_folder + "/network.npz");
  const RadianceField& source = stored.field;
  const StyleLayers layers = ReadLayers(style_folder, stored.records);
  std::vector<int64_t> of;
  if (!layers.empty()) of = RecordsInPageOrder(content->field, *source.geometry).splat;
  PageStyle style = EncodeStyle(network, made->field, StrengthOf(style_folder),
                                InPageOrder(layers, of), made->places);
  const Image picture = RenderHome(style.styled, HomeOf(*content));
  if (content->styles.empty() && style.header.At("strength").AsDouble() == 1)
    content->poster = EncodeJpeg(picture, kQuality);
  content->style_pictures.push_back(Thumbnail(picture, kThumbnail));
  if (!checked.empty()) {
    made->report.push_back(
        CheckLine("its style " + name,
                  CheckPage(ExactStyle(source, network, layers), style.styled, checked)));
    if (!style.residual.empty())
      made->report.push_back(Format("what style %s adds splat by splat: %.0f kB of the page",
                                    name.c_str(),
                                    static_cast<double>(InText(style.residual.size())) / 1e3));
  }
  style.styled = {};
  style.header["id"] = PageStyleId(style_folder);
  content->styles.push_back(std::move(style));
}

// The page of a field of `folder`, or of a part of it.
MadePage PageOf(StoredField stored, const std::string& folder,
                const std::vector<std::string>& styles, const PageOptions& options,
                const ProgressFunction& progress) {
  const int steps = 2 + static_cast<int>(styles.size());
  MadePage made;
  const WorkingViews views = ReadWorkingViews(folder + "/poses", kChecked, 0).InField(stored);
  PageContent content;
  content.served = options.served;
  EncodeScene(stored.field, views, options.names == "on", &content);
  if (stored.field.appearance.basis > kCodeHarmonics)
    made.report.push_back("the page shows harmonics up to degree 2; higher ones are left out");
  if (!options.check) stored.field.appearance = {};  // fields have gigabytes
  made.field = DecodeField(content.field);
  made.places = RecordsInPageOrder(content.field, *made.field.geometry);
  std::vector<Camera> checked;
  PageCheck check;
  if (options.check) {
    checked = CheckedViews(views.Cameras(), kChecked);
    check = CheckPage(stored.field, made.field, checked);
    made.report.push_back(CheckLine("the page's field", check));
  }
  content.poster = EncodeJpeg(RenderHome(made.field, HomeOf(content)), kQuality);
  for (size_t i = 0; i < styles.size(); ++i) {
    ReportOrThrow(progress, 1 + static_cast<int64_t>(i), steps);
    AddStyle(StyleFolder(folder, styles[i]), styles[i], stored, checked, &content, &made);
    if (options.names != "off") content.styles.back().header["name"] = styles[i];
  }
  ReportOrThrow(progress, steps - 1, steps);
  made.html = PageHtml(content, options.check ? &check : nullptr);
  made.bytes = std::ssize(made.html);
  made.splats = content.field.count();
  made.field_bytes = InText(content.field.bytes());
  for (const PageStyle& style : content.styles)
    made.style_bytes.push_back(InText(style.packed.size()) + InText(style.residual.size()));
  return made;
}

std::vector<Camera> PhotosOf(const std::string& folder, const StoredField& stored) {
  std::vector<Camera> photos;
  for (const Camera& camera :
       ReadWorkingViews(folder + "/poses", kChecked, 0).InField(stored).Cameras())
    photos.push_back(camera.Undistorted());
  return photos;
}

// The splats of a file, first those that photos show most.
class RankedSplats {
 public:
  RankedSplats(const std::string& path, const std::string& folder) : path_(path) {
    const StoredField geometry = ReadFieldGeometry(path);
    photos_ = PhotosOf(folder, geometry);
    order_ = ByWhatIsShown(geometry.field, photos_);
  }

  StoredField Read(int64_t most) const {
    return ReadPartOfField(path_, [&](const RadianceField&) {
      std::vector<uint8_t> kept(order_.size());
      for (int64_t i = 0; i < most; ++i)
        kept[static_cast<size_t>(order_[static_cast<size_t>(i)])] = 1;
      return kept;
    });
  }

  std::string Line(const MadePage& page) const {
    const std::vector<Camera> checked = CheckedViews(photos_, kChecked);
    const PageCheck check = CheckPage(SeenPart(ReadFieldGeometry(path_), path_, checked).field,
                                      page.field, checked);
    return Concat("the page has those ", page.splats, " of ", order_.size(),
                  " splats that photos show most: ") +
           CheckLine("its pictures", check);
  }

 private:
  std::string path_;
  std::vector<Camera> photos_;
  std::vector<int64_t> order_;
};

// How many splats the page may have, after one of `made` that has too many bytes, and after
// `before` with more splats; 0 where none fit.
int64_t FewerSplats(const MadePage& made, const MadePage* before, int64_t most_bytes) {
  double each;  // bytes of a splat
  if (before != nullptr && before->splats > made.splats && before->bytes > made.bytes) {
    each = static_cast<double>(before->bytes - made.bytes) /
           static_cast<double>(before->splats - made.splats);
  } else {
    int64_t of_splats = made.field_bytes;  // and a little of networks
    for (const int64_t bytes : made.style_bytes) of_splats += bytes;
    each = static_cast<double>(of_splats) / static_cast<double>(made.splats);
  }
  const double too_many = static_cast<double>(made.bytes - most_bytes) / each;
  return std::max(int64_t{0}, made.splats - 1 - static_cast<int64_t>(1.02 * too_many));
}

MadePage PageWithin(const std::string& folder, int64_t count,
                    const std::vector<std::string>& styles, const PageOptions& options,
                    const ProgressFunction& progress) {
  constexpr int kTries = 4;                 // the fewer splats, the more bytes each
  constexpr int64_t kLeastSplatBytes = 12;  // saves a try that cannot do
  const std::string path = folder + "/field.npz";
  int64_t most = options.most_bytes / kLeastSplatBytes;
  std::optional<RankedSplats> ranked;
  std::optional<MadePage> before;
  for (int i = 1;; ++i) {
    const bool all = count <= most;
    if (!all && !ranked) ranked.emplace(path, folder);
    MadePage made = PageOf(all ? ReadFieldFile(path) : ranked->Read(most), folder, styles,
                           options, progress);
    const bool fits = made.bytes <= options.most_bytes;
    if (fits && !all) made.report.push_back(ranked->Line(made));
    if (fits) return made;
    most = FewerSplats(made, before ? &*before : nullptr, options.most_bytes);
    made.html.clear();
    if (most == 0 || i == kTries) return made;
    before = std::move(made);
  }
}

}  // namespace

MadePage MakePage(const std::string& folder, const std::vector<std::string>& styles,
                  const PageOptions& options, const ProgressFunction& progress) {
  ReportOrThrow(progress, 0, 1);
  const std::string path = folder + "/field.npz";
  const int64_t count = CountSplats(path);
  if (count == 0) throw InputError("is a scene of voxels, which has no page", path, kNoPage);
  MadePage made = options.most_bytes > 0
                      ? PageWithin(folder, count, styles, options, progress)
                      : PageOf(ReadFieldFile(path), folder, styles, options, progress);
  if (!options.served) made.field = {}, made.places = {};
  return made;
}

}  // namespace regrade
