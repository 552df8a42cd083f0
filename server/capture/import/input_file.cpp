#include "capture/import/input_file.hpp"

#include <algorithm>
#include <memory>

#include <zlib.h>

#include "base/bytes.hpp"
#include "capture/output_file.hpp"

namespace fiducap {

Expected<InputFile> InputFile::open(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error))
    return fail(ErrorCode::kNotFound, "no such file", path);
  InputFile file;
  file.path_ = path;
  file.size_ = std::filesystem::file_size(path, error);
  if (error) return fail(ErrorCode::kUnavailable, "cannot be read: " + error.message(), path);
  file.file_.open(path, std::ios::binary);
  if (!file.file_) return fail(ErrorCode::kUnavailable, "cannot be opened for reading", path);
  return file;
}

bool InputFile::read(std::uint64_t n, std::vector<std::byte>& out) {
  if (n > left()) return false;
  out.resize(static_cast<std::size_t>(n));
  if (n == 0) return true;
  if (!file_.read(reinterpret_cast<char*>(out.data()), static_cast<std::streamsize>(n))) {
    size_ = at_;  // truncated meanwhile, or a disk error
    return false;
  }
  at_ += n;
  return true;
}

namespace {

constexpr std::uint32_t kZipEnd = 0x06054b50;
constexpr std::uint32_t kZipDirectoryEntry = 0x02014b50;
constexpr std::uint32_t kZipLocalHead = 0x04034b50;
constexpr std::size_t kZipEnd_bytes = 22;
constexpr std::size_t kZipLocalHead_bytes = 30;
constexpr std::uint64_t kLongestComment = 65535;
constexpr std::uint64_t kLargestDirectory_bytes = 64 << 20;
constexpr std::uint64_t kMoreThanArchive_bytes = std::uint64_t{1} << 30;
constexpr std::uint16_t kStored = 0;
constexpr std::uint16_t kDeflated = 8;
constexpr std::uint16_t kEncrypted = 1;
constexpr std::size_t kZipPiece_bytes = 1 << 18;

/// Numbers beyond 32 bits; some writers always put them here.
void read_zip64(std::span<const std::byte> extra, ZipEntry& entry) {
  constexpr std::uint16_t kZip64 = 1;
  constexpr std::uint64_t kElsewhere = 0xffffffff;
  LittleEndianReader fields(extra);
  while (fields.left() > 0) {
    const std::uint16_t id = fields.u16();
    LittleEndianReader numbers(fields.bytes(fields.u16()));
    if (fields.failed()) return;
    if (id != kZip64) continue;
    for (std::uint64_t* number : {&entry.bytes, &entry.packed_bytes, &entry.at})
      if (*number == kElsewhere) *number = numbers.u64();
  }
}

/// Writes the content of an entry and compares it with the directory.
class ZipOutput final {
 public:
  ZipOutput(OutputFile file, const ZipEntry& entry) : file_(std::move(file)), entry_(entry) {}

  Expected<void> write(std::span<const std::byte> bytes) {
    written_ += bytes.size();
    if (written_ > entry_.bytes)
      return fail(ErrorCode::kInvalid, "unpacks to more than its stated size");
    crc_ = static_cast<std::uint32_t>(
        crc32_z(crc_, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
    return file_.write(text_of_bytes(bytes));
  }
  Expected<void> finish() {
    if (written_ != entry_.bytes || crc_ != entry_.crc)
      return fail(ErrorCode::kInvalid, "is damaged: wrong size or checksum");
    return file_.close();
  }

 private:
  OutputFile file_;
  const ZipEntry& entry_;
  std::uint64_t written_{0};
  std::uint32_t crc_{0};
};

Expected<void> copy_stored(InputFile& archive, const ZipEntry& entry, ZipOutput& out) {
  std::vector<std::byte> piece;
  for (std::uint64_t left = entry.packed_bytes; left > 0; left -= piece.size()) {
    if (!archive.read(std::min<std::uint64_t>(left, kZipPiece_bytes), piece))
      return fail(ErrorCode::kTruncated, "is cut");
    if (const auto written = out.write(piece); !written) return written;
  }
  return {};
}

Expected<void> inflate_entry(InputFile& archive, const ZipEntry& entry, ZipOutput& out) {
  struct End {
    void operator()(z_stream* s) const { inflateEnd(s); }
  };
  z_stream stream{};
  constexpr int kNoHead = -MAX_WBITS;
  if (inflateInit2(&stream, kNoHead) != Z_OK)
    return fail(ErrorCode::kUnavailable, "there was no memory to unpack it");
  const std::unique_ptr<z_stream, End> closes(&stream);
  std::vector<std::byte> in;
  std::vector<std::byte> piece(kZipPiece_bytes);
  std::uint64_t left = entry.packed_bytes;
  for (int code = Z_OK; code != Z_STREAM_END;) {
    if (stream.avail_in == 0) {
      if (left == 0 || !archive.read(std::min<std::uint64_t>(left, kZipPiece_bytes), in))
        return fail(ErrorCode::kTruncated, "is cut");
      left -= in.size();
      stream.next_in = reinterpret_cast<Bytef*>(in.data());
      stream.avail_in = static_cast<uInt>(in.size());
    }
    stream.next_out = reinterpret_cast<Bytef*>(piece.data());
    stream.avail_out = static_cast<uInt>(piece.size());
    code = inflate(&stream, Z_NO_FLUSH);
    if (code != Z_OK && code != Z_STREAM_END && code != Z_BUF_ERROR)
      return fail(ErrorCode::kInvalid, "cannot be unpacked: it is damaged");
    const std::size_t given = piece.size() - stream.avail_out;
    if (const auto written = out.write(std::span(piece).first(given)); !written) return written;
  }
  return {};
}

}  // namespace

Expected<ZipArchive> ZipArchive::open(const std::string& path) {
  ZipArchive archive(path);
  return archive.read_directory().map([&] { return std::move(archive); });
}

Expected<void> ZipArchive::read_directory() {
  auto file = InputFile::open(path_);
  if (!file) return tl::unexpected(file.error());
  size_ = file->size();
  may_unpack_ = size_ + kMoreThanArchive_bytes;
  // Search from the end of the file: a comment may follow.
  const std::uint64_t tail = std::min<std::uint64_t>(size_, kZipEnd_bytes + kLongestComment);
  std::vector<std::byte> bytes;
  if (!file->seek(size_ - tail) || !file->read(tail, bytes)) bytes.clear();
  for (std::size_t at = bytes.size(); at-- > 0;) {
    LittleEndianReader from(std::span<const std::byte>(bytes).subspan(at));
    if (from.left() < kZipEnd_bytes || from.u32() != kZipEnd) continue;
    from.bytes(6);
    const std::size_t count = from.u16();
    const std::uint64_t length = from.u32();
    const std::uint64_t begin = from.u32();
    if (count == 0xffff || begin == 0xffffffff)
      return fail(ErrorCode::kUnsupported,
                  "is a ZIP archive beyond 4 GB: unpack it and import the folder", path_);
    if (length > kLargestDirectory_bytes || begin + length > size_) continue;
    if (!file->seek(begin) || !file->read(length, bytes)) break;
    return read_entries(std::move(bytes), count);
  }
  return fail(ErrorCode::kInvalid, "is no complete ZIP archive: it has no directory at its end",
              path_);
}

Expected<void> ZipArchive::read_entries(std::vector<std::byte> directory, std::size_t count) {
  LittleEndianReader from(directory);
  for (std::size_t i = 0; i < count; ++i) {
    ZipEntry entry;
    if (from.u32() != kZipDirectoryEntry) break;
    from.bytes(4);
    const std::uint16_t flags = from.u16();
    entry.method = from.u16();
    from.u32();  // time
    entry.crc = from.u32();
    entry.packed_bytes = from.u32();
    entry.bytes = from.u32();
    const std::size_t name = from.u16();
    const std::size_t extra = from.u16();
    const std::size_t comment = from.u16();
    from.bytes(8);
    entry.at = from.u32();
    entry.name = text_of_bytes(from.bytes(name));
    read_zip64(from.bytes(extra), entry);
    from.bytes(comment);
    if (from.failed()) break;
    if ((flags & kEncrypted) != 0) entry.method = 0xffff;
    entries_.push_back(std::move(entry));
  }
  if (entries_.size() == count) return {};
  return fail(ErrorCode::kInvalid, "has a damaged directory", path_);
}

Expected<void> ZipArchive::unpack(const ZipEntry& entry, const std::filesystem::path& to) {
  const std::string where = path_ + ", " + std::filesystem::path(entry.name).filename().string();
  if (entry.method != kStored && entry.method != kDeflated)
    return fail(ErrorCode::kUnsupported,
                "is encrypted, or packed by an unsupported method: unpack the archive and import "
                "the folder",
                where);
  if (entry.bytes > may_unpack_)
    return fail(ErrorCode::kUnsupported, "the archive unpacks to far more than its own size",
                where);
  may_unpack_ -= entry.bytes;
  auto archive = InputFile::open(path_);
  if (!archive) return tl::unexpected(archive.error());
  std::vector<std::byte> head;
  if (!archive->seek(entry.at) || !archive->read(kZipLocalHead_bytes, head))
    return fail(ErrorCode::kTruncated, "is not in the archive", where);
  LittleEndianReader from(head);
  const bool is_head = from.u32() == kZipLocalHead;
  from.bytes(22);
  const std::uint64_t names = std::uint64_t{from.u16()} + from.u16();
  if (!is_head || !archive->skip(names) || entry.packed_bytes > archive->left())
    return fail(ErrorCode::kInvalid, "is not at its place in the directory", where);
  auto file = OutputFile::create(to);
  if (!file) return tl::unexpected(file.error());
  ZipOutput out(std::move(*file), entry);
  auto done = entry.method == kStored ? copy_stored(*archive, entry, out)
                                      : inflate_entry(*archive, entry, out);
  if (done) done = out.finish();
  if (done) return {};
  Error error = done.error();
  if (error.context.empty()) error.context = where;
  return tl::unexpected(error);
}

}  // namespace fiducap
