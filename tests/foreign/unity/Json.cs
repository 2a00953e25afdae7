using System;
using System.Collections.Generic;
using System.Globalization;
using System.Reflection;
using System.Text;

/// <summary>Reads JSON to dictionaries, lists, strings, numbers and truth values.</summary>
public static class Json
{
    public static object Read(string text)
    {
        int at = 0;
        object value = Value(text, ref at);
        Skip(text, ref at);
        if (at != text.Length) { throw new ArgumentException("more than one value of JSON"); }
        return value;
    }

    /// <summary>An object of plain fields, as JsonUtility makes it.</summary>
    public static object Fill(object json, Type type)
    {
        var list = json as List<object>;
        if (list != null)
        {
            Type element = type.GetElementType();
            Array array = Array.CreateInstance(element, list.Count);
            for (int i = 0; i < list.Count; i++) { array.SetValue(Fill(list[i], element), i); }
            return array;
        }
        var members = json as Dictionary<string, object>;
        if (members == null) { return json; }
        object filled = Activator.CreateInstance(type, true);
        foreach (FieldInfo field in type.GetFields())
        {
            object member;
            if (members.TryGetValue(field.Name, out member)) { field.SetValue(filled, Fill(member, field.FieldType)); }
        }
        return filled;
    }

    static void Skip(string text, ref int at)
    {
        while (at < text.Length && char.IsWhiteSpace(text[at])) { at++; }
    }

    static object Value(string text, ref int at)
    {
        Skip(text, ref at);
        if (at == text.Length) { throw new ArgumentException("JSON ends early"); }
        char first = text[at];
        if (first == '{')
        {
            var members = new Dictionary<string, object>();
            while (Next(text, ref at, '}'))
            {
                string name = (string)Value(text, ref at);
                Skip(text, ref at);
                at++;
                members[name] = Value(text, ref at);
            }
            return members;
        }
        if (first == '[')
        {
            var list = new List<object>();
            while (Next(text, ref at, ']')) { list.Add(Value(text, ref at)); }
            return list;
        }
        if (first == '"') { return Text(text, ref at); }
        int end = at;
        while (end < text.Length && ",]} \n\r\t".IndexOf(text[end]) < 0) { end++; }
        string word = text.Substring(at, end - at);
        at = end;
        switch (word)
        {
            case "true": return true;
            case "false": return false;
            case "null": return null;
        }
        double number;
        if (!double.TryParse(word, NumberStyles.Float, CultureInfo.InvariantCulture, out number))
        {
            throw new ArgumentException("no JSON: " + word);
        }
        return number;
    }

    /// <summary>Moves over "{", "[" or ","; false at the end.</summary>
    static bool Next(string text, ref int at, char end)
    {
        Skip(text, ref at);
        at++;
        int ahead = at;
        Skip(text, ref ahead);
        if (text[at - 1] == end) { return false; }
        if (text[ahead] == end) { at = ahead + 1; return false; }
        return true;
    }

    static string Text(string text, ref int at)
    {
        var result = new StringBuilder();
        for (at++; text[at] != '"'; at++)
        {
            if (text[at] != '\\') { result.Append(text[at]); continue; }
            at++;
            switch (text[at])
            {
                case 'n': result.Append('\n'); break;
                case 't': result.Append('\t'); break;
                case 'r': result.Append('\r'); break;
                case 'b': result.Append('\b'); break;
                case 'f': result.Append('\f'); break;
                case 'u':
                    result.Append((char)int.Parse(text.Substring(at + 1, 4), NumberStyles.HexNumber));
                    at += 4;
                    break;
                default: result.Append(text[at]); break;
            }
        }
        at++;
        return result.ToString();
    }
}
