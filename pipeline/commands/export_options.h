// What `regrade export` is asked for.
#pragma once

#include <string>
#include <vector>

namespace regrade {

struct ExportOptions {
  std::string out;
  std::string format = "colmap-text";
  std::vector<std::string> names;
  float thousands = 500;
  bool thousands_given = false;
  bool dry_run = false;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("out", out, {.help = "the folder to write, a new or empty one; of cube the file"});
    bind("format", format,
         {.help =
              "colmap-text and colmap write images/ and sparse/; transforms writes images/ "
              "and transforms.json for nerfstudio and instant-ngp. ply, spz, glb and "
              "compressed-ply write a scene of splats and each style for viewers, editors and "
              "engines: field.EXT and NAME.EXT, cameras.json, and transform.json, which leads "
              "back to the photos' world; a voxel field becomes splats by a fit first. Of "
              "voxels svox2 writes .npz files that svox2 reads, and "
              "points PLY files of points with colours, approximately on the surfaces. cube "
              "writes one style as a LUT for photo and video editors, to the file --out",
          .choices = "colmap-text|colmap|transforms|ply|spz|glb|compressed-ply|points|svox2|"
                     "cube"});
    bind(
        "name", names,
        {.help = "only this style, and not the scene as it was; may be given several times. Of "
                 "cube the style, by default the last one"});
    bind("splats", thousands,
         {.unit = "thousands",
          .help = "most splats that are fitted to voxels",
          .min = 1,
          .max = 20000});
    bind("dry-run", dry_run, {.help = "prints what would be written, and does nothing"});
  }
};

}  // namespace regrade
