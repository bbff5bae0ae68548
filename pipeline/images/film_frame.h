// What a film says of its frames: how they are turned, and whether they show two moments.
#pragma once

struct AVFrame;
struct AVStream;

namespace regrade {

// EXIF's number, 1 to 8, for how a player turns and mirrors the stored frames.
int OrientationOf(const AVStream& stream);

// An interlaced frame shows two moments, in its even and its odd rows: the rows of the first
// are kept, and those between become the mean of their neighbours. Returns whether that was
// done: not for other frames, and not where pixels are no whole bytes. Throws std::bad_alloc.
bool KeepOneField(AVFrame* frame);

}  // namespace regrade
