// A link to what is closed opens it, and what it is in.
function reveal() {
  const target = document.getElementById(location.hash.slice(1));
  if (!target) return;
  for (let part = target.querySelector(":scope > details") ?? target; part; part = part.parentElement) {
    if (part.matches("details")) part.open = true;
  }
  target.scrollIntoView({ behavior: "instant" });
}

addEventListener("hashchange", reveal);
reveal();
