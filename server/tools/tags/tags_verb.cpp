#include <filesystem>

#include <nlohmann/json.hpp>

#include "base/whole_file.hpp"
#include "detection/sheet/tag_sheet.hpp"
#include "detection/tag_family.hpp"
#include "tools/verb_options.hpp"

namespace fiducap {
namespace {

/// The YAML file beside the sheet must not replace a user's configuration.
Expected<void> may_write(const std::string& out, const std::string& stub) {
  if (stub == out)
    return fail(ErrorCode::kInvalid, "the sheet is a PDF: --out must end in .pdf, not in .yaml",
                out);
  std::error_code ignored;
  if (!std::filesystem::exists(stub, ignored)) return {};
  const auto before = read_whole_file(stub);
  if (before && before->starts_with(kTagSheetHeading)) return {};
  return fail(
      ErrorCode::kInvalid,
      "is there already and is not of a sheet: it would be written over; give --out another name",
      stub);
}

struct TagSheetArguments {
  std::string ids{"0-11"};
  std::string family{"tag36h11"};
  std::string paper{"a4"};
  std::string out{"tags.pdf"};
  double size_mm{160};
  bool json{false};
};

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
  if (arguments.json)
    return print_json(terminal, {{"pdf", arguments.out},
                                 {"yaml", stub},
                                 {"family", order.family},
                                 {"ids", *ids},
                                 {"size_mm", order.size_mm},
                                 {"paper", paper->name}});
  terminal.out << arguments.out << ": " << ids->size() << " tags " << order.family << ", "
               << order.size_mm << " mm, " << paper->name << "\n"
               << stub << ": family and sizes for the server's configuration\n"
               << "Print at 100 % and measure the ruler: it must be 100 mm long.\n";
  if (const std::string warning = tag_family_warning(order.family); !warning.empty())
    terminal.err << warning << "\n";
  return kExitOk;
}

}  // namespace

void add_tags(CLI::App& app, ChosenVerb& chosen) {
  auto* tags = app.add_subcommand("tags", "Tags to print");
  tags->require_subcommand(1);
  tags->footer("Example:\n  fiducap tags sheet --ids 0-11 --size-mm 160 --paper a4 --out tags.pdf");
  auto* verb = tags->add_subcommand(
      "sheet",
      "A PDF with tags of exact size, cut marks and a ruler, and their sizes as YAML beside it");
  auto& a = arguments_of<TagSheetArguments>(*verb, chosen, run_tag_sheet);
  verb->add_option("--ids", a.ids, "Ids and ranges, e.g. 0-3,7")->capture_default_str();
  add_positive(*verb, "--size-mm", a.size_mm, "Edge between black and white border");
  verb->add_option("--paper", a.paper, "a4, a3 or letter")
      ->check(CLI::IsMember({"a4", "a3", "letter"}))
      ->capture_default_str();
  verb->add_option("--family", a.family, "Tag family: " + tag_family_names())
      ->capture_default_str();
  verb->add_option("--out", a.out, "The PDF")->capture_default_str();
  verb->add_flag("--json", a.json, "One JSON object for scripts");
  verb->footer(
      "Print at 100 %, then measure the ruler on the sheet.\n"
      "Example:\n  fiducap tags sheet --ids 0-11 --size-mm 160 --paper a4 --out tags.pdf");
}

}  // namespace fiducap
