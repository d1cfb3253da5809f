#include "compositing/composite/object.h"

#include "compositing/picture/picture.h"
#include "core/base/status.h"
#include "core/composite/compositor.h"
#include "core/footprint/composite_error.h"
#include "core/matte/pixel_count.h"

namespace glasswing {

namespace fs = std::filesystem;

namespace {

// What --crop leaves, in the camera's pixels; all if it is empty or, which cropped() refuses, invalid.
MatteRegion kept_region(const std::string& crop, const MatteOutline& outline) {
  const absl::StatusOr<MatteRegion> region = parse_region(crop);
  const bool inside = region.ok() && check_region(*region, outline.width_px, outline.height_px).ok();
  MatteRegion kept =
      inside ? *region : MatteRegion{.width_px = outline.width_px, .height_px = outline.height_px};
  kept.x_px += outline.x0_px;
  kept.y_px += outline.y0_px;
  return kept;
}

}  // namespace

ObjectInFront::ObjectInFront(std::string file, std::shared_ptr<const MappedFile> mapped, MatteOutline outline,
                             const CompositeArguments& arguments)
    : file_(std::move(file)),
      mapped_(std::move(mapped)),
      outline_(std::move(outline)),
      crop_(arguments.crop),
      fill_(arguments.fill),
      foreground_gain_(arguments.foreground_gain),
      unsolved_(static_cast<size_t>(outline_.width_px) * outline_.height_px) {
  if (arguments.object) coverage_ = RadianceImage(outline_.width_px, outline_.height_px, 1);
}

absl::StatusOr<ObjectInFront> ObjectInFront::create(const fs::path& file, const CompositeArguments& arguments,
                                                    Pictures pictures) {
  GW_ASSIGN_OR_RETURN(std::shared_ptr<const MappedFile> mapped, MappedFile::open(file));
  absl::StatusOr<MatteOutline> outline = outline_of(mapped->bytes());
  if (!outline.ok()) return in_file(file.string(), outline.status());
  ObjectInFront object(file.string(), std::move(mapped), *std::move(outline), arguments);
  GW_RETURN_IF_ERROR(in_file(object.file_, object.prepare(pictures, arguments.exact)));
  return object;
}

absl::Status ObjectInFront::prepare(Pictures pictures, bool exact) {
  if (exact) {
    GW_ASSIGN_OR_RETURN(exact_, decode_matte(mapped_->bytes(), Pyramids::kKept));
    take(*exact_);
  } else if (pictures == Pictures::kMany) {
    GW_ASSIGN_OR_RETURN(many_, FastCompositor::create(mapped_->bytes(), [this](Matte& rows) { take(rows); }));
  }
  return absl::OkStatus();
}

void ObjectInFront::take(Matte& rows) {
  const int top = rows.y0_px() - outline_.y0_px;
  note_unsolved(rows, top, unsolved_);
  {
    const PixelCount count = count_pixels(rows, kept_region(crop_, outline_));
    const std::lock_guard lock(counted_->mutex);
    counted_->pixels += count;
  }
  for (int y = 0; y < rows.height_px(); ++y) {
    for (int x = 0; x < rows.width_px(); ++x) {
      if (!coverage_.empty()) coverage_.at(x, top + y, 0) = rows.coverage(x, y);
      for (float& light : rows.foreground(x, y)) light *= foreground_gain_;
      for (int c = 0; c < kChannels; ++c) {
        for (PyramidFootprint& own : rows.pyramids(x, y, c)) own.foreground *= foreground_gain_;
      }
    }
  }
}

absl::StatusOr<RadianceImage> ObjectInFront::composite_whole(const std::vector<RadianceImage>& backgrounds,
                                                             const std::function<void(double)>& progress) {
  if (exact_) return glasswing::composite(*exact_, backgrounds, 0, progress);
  if (many_) return many_->composite(backgrounds);
  absl::StatusOr<RadianceImage> made = composite_file(
      mapped_->bytes(), backgrounds, [this](Matte& rows) { take(rows); }, 0, progress);
  if (!made.ok()) return in_file(file_, made.status());
  return made;
}

absl::StatusOr<ObjectPicture> ObjectInFront::composite(const std::vector<RadianceImage>& backgrounds,
                                                       const std::function<void(double)>& progress) {
  ObjectPicture made;
  GW_ASSIGN_OR_RETURN(RadianceImage whole, composite_whole(backgrounds, progress));
  if (fill_) fill_unsolved(unsolved_, whole);
  GW_ASSIGN_OR_RETURN(made.light, cropped(whole, crop_));
  if (!coverage_.empty()) {
    GW_ASSIGN_OR_RETURN(made.coverage, cropped(coverage_, crop_));
  }
  return made;
}

absl::StatusOr<RadianceImage> ObjectInFront::error(const std::vector<RadianceImage>& backgrounds,
                                                   const std::function<void(double)>& progress) const {
  GW_ASSIGN_OR_RETURN(const Matte matte, decode_matte(mapped_->bytes(), Pyramids::kKept));
  GW_ASSIGN_OR_RETURN(const RadianceImage whole, composite_error(matte, backgrounds, 0, progress));
  return cropped(whole, crop_);
}

}  // namespace glasswing
