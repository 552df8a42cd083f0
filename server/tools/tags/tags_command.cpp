#include "tools/tags/tags_command.hpp"

#include <filesystem>

#include <nlohmann/json.hpp>

#include "base/whole_file.hpp"
#include "detection/sheet/tag_sheet.hpp"
#include "detection/tag_family_list.hpp"

namespace fiducap {

namespace {

/// The file for the server goes beside the sheet, but over no configuration that a person wrote.
Expected<void> may_write(const std::string& out, const std::string& stub) {
  if (stub == out)
    return fail(ErrorCode::kInvalid, "the sheet is a PDF: --out must end in .pdf, not in .yaml",
                out);
  std::error_code ignored;
  if (!std::filesystem::exists(stub, ignored)) return {};
  const auto before = read_whole_file(stub);
  if (before && before->starts_with(kTagSheetHeading)) return {};
  return fail(ErrorCode::kInvalid,
              "is there already and is not of a sheet: it would be written over; give --out "
              "another name",
              stub);
}

}  // namespace

int run_tag_sheet(const TagSheetArguments& arguments, const Terminal& terminal) {
  const auto ids = parse_id_list(arguments.ids);
  const auto paper = paper_named(arguments.paper);
  if (!ids || !paper) {
    report(terminal, ids ? Error{ErrorCode::kInvalid,
                                 "paper is a4, a3 or letter, not '" + arguments.paper + "'",
                                 {}}
                         : ids.error());
    return kExitUsage;
  }
  const TagSheetOrder order{listed_tag_family(arguments.family), *ids, arguments.size_mm, *paper};
  const auto pdf = tag_sheet_pdf(order);
  if (!pdf) return report(terminal, pdf.error());
  const std::string stub = std::filesystem::path(arguments.out).replace_extension(".yaml").string();
  if (const auto free = may_write(arguments.out, stub); !free)
    return report(terminal, free.error());
  if (auto written = write_whole_file(arguments.out, *pdf); !written)
    return report(terminal, written.error());
  if (auto written = write_whole_file(stub, tag_sheet_yaml(order)); !written)
    return report(terminal, written.error());
  if (arguments.json) {
    const nlohmann::ordered_json json{{"pdf", arguments.out},     {"yaml", stub},
                                      {"family", order.family},   {"ids", *ids},
                                      {"size_mm", order.size_mm}, {"paper", paper->name}};
    terminal.out << json.dump(2) << "\n";
    return kExitOk;
  }
  terminal.out << arguments.out << ": " << ids->size() << " tags " << order.family << ", "
               << order.size_mm << " mm, " << paper->name << "\n"
               << stub << ": family and sizes for the server's configuration\n"
               << "Print at 100 % and measure the ruler: it must be 100 mm long.\n";
  if (const std::string warning = tag_family_warning(order.family); !warning.empty())
    terminal.err << warning << "\n";
  return kExitOk;
}

}  // namespace fiducap
