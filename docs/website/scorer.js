/** Rank what a search of the site finds: Sphinx gives 15 to a title and 5 to a text, however often it has the words.
 * Plugins whose summary has all words of the query come before other texts. */
var Scorer = {
  score([page, , , , score, , kind]) {
    const asked = new URLSearchParams(location.search).get("q").toLowerCase().match(/[\p{L}\p{N}_]+/gu) ?? [];
    const told = SUMMARIES[page]?.toLowerCase().match(/[\p{L}\p{N}_]+/gu) ?? [];
    const isTold = asked.length && asked.every((word) => told.some((it) => it.startsWith(word)));
    return kind === "text" && isTold ? score + 9 : score;
  },
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
