// What `regrade view` answers: the page of a scene, styles from pictures that are dropped on
// it, and exact films of its camera paths.
//
//   GET /         opens the page: asks for it with the token of the address
//   GET /page     the page, as `regrade page` writes it, allowed to ask here; status 202 and
//                 what it waits for until it is made, when what follows is refused
//   POST /style   a picture; `regrade stylize` learns it in styles/NAME/. The answer is a job
//   POST /film    camera_path.json; `regrade render --path` writes films/. The answer is a job
//   GET /job      the job's state
//   DELETE /job   cancels it
//   GET /learning the network of the style that is being learned, so far, or nothing new
//   GET /style    the network of the style that was learned last, as the page holds it
//   GET /learning/codes, /style/codes    what these networks make of the page's splats, for a
//                 page whose graphics processor is slow: 16 bytes a splat, in the page's order
//   GET /film     the film that was rendered last
#pragma once

#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "kernels/base/progress.h"
#include "kernels/field/radiance_field.h"
#include "pipeline/fields/network_file.h"
#include "pipeline/files/folder_identity.h"
#include "pipeline/page/local_server.h"
#include "pipeline/page/view_job.h"

namespace regrade {

inline constexpr uint64_t kMostPictureBytes = 32 << 20, kMostPathBytes = 4 << 20;

class ViewSession {
 public:
  // `style_flags`: of the commands that learn styles, besides their picture and name.
  ViewSession(const std::string& folder, const std::vector<std::string>& style_flags);

  // They refer to this object, and may be asked before and while the page is made.
  std::vector<Route> Routes();
  // What whoever opens the page reads until it is made.
  void SayWhatIsAwaited(const std::string& text);
  // Makes the page of the folder with these styles, once. Throws as MakePage.
  void MakePageOf(const std::vector<std::string>& styles, const ProgressFunction& progress);
  // Throws Error(kResources) once the folder is not where it was.
  void CheckFolder() const;

 private:
  HttpResponse Opening() const;
  std::optional<HttpResponse> NotYet(const std::string& target) const;
  HttpResponse TakePicture(const HttpRequest& request);
  HttpResponse TakePath(const HttpRequest& request);
  HttpResponse JobState() const;
  HttpResponse StyleSoFar();
  // A style as JSON, and its codes.
  struct Served {
    std::string json, codes;
  };
  Served Serve(const StoredNetwork& network, const std::string& id,
               const std::string& name) const;

  const std::string folder_;
  const FolderIdentity identity_;
  const std::vector<std::string> style_flags_;
  std::string page_;             // with the next two unchanged once made_ is set
  RadianceField field_;          // the page's
  std::vector<int64_t> splats_;  // of the field, in the page's order
  mutable std::mutex mutex_;     // of what follows: pages and jobs end on their own threads
  bool made_ = false;
  std::string awaited_;
  Served style_, so_far_;
  std::string film_;      // the file's path
  std::string learning_;  // the style's folder
  int64_t step_ = -1;     // of what StyleSoFar told last
  ViewJob job_;           // last: ends before the rest
};

}  // namespace regrade
