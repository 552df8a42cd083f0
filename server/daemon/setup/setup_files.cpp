#include "daemon/setup/setup_files.hpp"

#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <numeric>

#include "base/whole_file.hpp"
#include "capture/v4l2/camera_list.hpp"
#include "daemon/secret.hpp"
#include "detection/sheet/tag_sheet.hpp"
#include "detection/tag_family_list.hpp"

namespace fiducap {

namespace {

namespace fs = std::filesystem;

constexpr std::size_t kPrintedTags = 12;  // enough for a room; all families have as many

/// An earlier one is kept: somebody may know it.
Expected<void> write_token(const std::string& file) {
  std::error_code ignored;
  if (fs::exists(file, ignored)) return {};
  return write_whole_file(file, fresh_secret() + "\n", 0600);
}

}  // namespace

std::string token_file_of(const std::string& file) {
  return fs::path(file).replace_extension(".token").string();
}

std::vector<FoundCamera> found_cameras() {
  std::vector<FoundCamera> all;
  for (const ListedCamera& camera : list_cameras({})) {
    all.push_back({camera.open(), camera.name + " (" + camera.device + ")",
                   camera.closed ? camera.closed->text() : ""});
  }
  return all;
}

Expected<std::string> setup_sheet(const SetupCommand& order) {
  const auto paper = paper_named(order.text("paper"));
  if (!paper)
    return fail(ErrorCode::kInvalid, "must be a4, a3 or letter", "paper = " + order.text("paper"));
  const auto size_mm = order.number("size_mm");
  if (!size_mm || !(*size_mm > 0))
    return fail(ErrorCode::kInvalid, "must be the edge of the black square in mm, e.g. 160",
                "size_mm = " + order.text("size_mm"));
  std::vector<int> ids(kPrintedTags);
  std::iota(ids.begin(), ids.end(), 0);
  return tag_sheet_pdf({listed_tag_family(order.text("family")), ids, *size_mm, *paper});
}

std::string setup_preview(const std::string& file, const SetupResult& result) {
  const std::string name = fs::path(file).filename().string();
  const std::string store = fs::path(name).replace_extension(".sqlite").string();
  return setup_text(result, store, token_file_of(name));
}

Expected<void> can_write_setup(const std::string& file) {
  std::error_code ignored;
  if (fs::exists(file, ignored) && !fs::is_regular_file(file, ignored))
    return fail(ErrorCode::kInvalid, "must be a file to be made, and is no file", file);
  const fs::path folder = fs::absolute(file).parent_path();
  if (!fs::is_directory(folder, ignored))
    return fail(ErrorCode::kNotFound, "there is no such folder: make it, or name another file",
                folder.string());
  if (::access(folder.c_str(), W_OK) != 0)
    return fail(ErrorCode::kUnavailable,
                "nothing can be written there (" + std::string(std::strerror(errno)) +
                    "): name a file elsewhere",
                folder.string());
  return {};
}

Expected<void> write_setup(const std::string& file, const SetupResult& result, bool replace) {
  std::error_code ignored;
  if (!replace && fs::exists(file, ignored))
    return fail(ErrorCode::kInvalid, "is there already: replace it?", file);
  const std::string text = setup_preview(file, result);
  const auto read = parse_config(text, file);
  if (!read) return fail(ErrorCode::kInvalid, read.error().front().text(), file);
  if (auto token = write_token(token_file_of(file)); !token) return token;
  return write_whole_file(file, text);
}

}  // namespace fiducap
